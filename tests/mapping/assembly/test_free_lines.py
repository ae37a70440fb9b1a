"""Wide details of rasters: every sweep shows their section, and together they are one line or spot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import grey_dilation

from mapping import Feature, FloatArray, Trace
from mapping.assembly import assemble
from mapping.assembly.free import free_sections
from mapping.assembly.free.mean_section import mean_sizes
from mapping.base import LaidTrace, fit_base
from mapping.detection import detect
from mapping.geometry.templates.shapes import cap_height, step_height
from mapping.inference.joint import refine_all

TIP, FINE, SAMPLING, PITCH = 2e-6, 0.125e-6, 8, 15e-6
Form = Callable[[FloatArray, FloatArray], FloatArray]


def felt(form: Form, seed: int, noise: float, rows: int = 14, pitch: float = PITCH) -> tuple[Feature, ...]:
    """What is found on a raster of 0.5 mm, each row by brute-force dilation of heights over x and y from its middle."""
    x, rng, sweeps = FINE * np.arange(-2000, 2000), np.random.default_rng(seed), []
    reach = int(TIP / FINE)
    ball = np.sqrt(TIP**2 - (FINE * np.arange(-reach, reach + 1)) ** 2) - TIP
    for k in range(rows):
        y = pitch * (k - 0.5 * (rows - 1))
        trace = grey_dilation(form(x, np.full_like(x, y)), structure=ball, mode="nearest")[::SAMPLING]
        height = trace + noise * rng.standard_normal(len(trace)) + TIP
        sweeps.append(np.column_stack([x[::SAMPLING], np.full(len(trace), y), height]))
    count = len(sweeps[0])
    centers = np.concatenate(sweeps)
    raster = Trace(1e-3 * np.arange(len(centers)), centers, np.repeat(np.arange(rows), count), TIP)
    base = fit_base(raster)
    features = refine_all(assemble(detect(raster, base), raster, base), raster, seed, base=base)
    return tuple(feature for feature in features if feature.evidence.likely)


def scratch(x: FloatArray, y: FloatArray) -> FloatArray:
    return -np.maximum(0.0, 1.2e-6 * (1.0 - np.abs(x - 0.1 * y) / 8e-6)) * (np.abs(y) < 60e-6)


def slot(x: FloatArray, y: FloatArray) -> FloatArray:
    return np.where((np.abs(x - 0.2 * y) < 10e-6) & (np.abs(y) < 60e-6), -1.5e-6, 0.0)


def bead(x: FloatArray, y: FloatArray) -> FloatArray:
    return np.maximum(0.0, 1e-6 * (1.0 - ((x + 0.3 * y) / 12e-6) ** 2)) * (np.abs(y) < 60e-6)


@pytest.mark.parametrize(
    ("form", "kind", "height", "width"),
    [
        (scratch, "groove", -1.2e-6, 16e-6),
        pytest.param(slot, "groove", -1.5e-6, 19.6e-6, marks=pytest.mark.slow),
        pytest.param(bead, "ridge", 1e-6, 23e-6, marks=pytest.mark.slow),
    ],
)
def test_a_wide_line_is_one_with_the_sizes_of_its_mean_section(
    form: Form, kind: str, height: float, width: float
) -> None:
    (found,) = felt(form, 11, 60e-9)
    assert found.kind == kind
    # walls that rows beside end are fitted (`plateaus`); these rows are dilated in their own planes, and at a slant the
    # flanks of walls are 2 % wider than a ball's, which an ideal groove takes for width
    assert bool(found.details.free_section) == (form is not slot)
    for size, true in ((found.height, height), (found.width, width), (found.length, 121e-6)):
        spread = size.high - size.low + (0.02 * abs(true) if form is slot else 0.0)
        assert size.median - spread < true < size.median + spread
    assert abs(found.height.median - height) < 0.08e-6
    assert abs(found.width.median - width) < 1.0e-6
    assert abs(found.length.median - 121e-6) < PITCH
    assert not found.length.censored and found.evidence.crossings >= 7
    assert found.details.misfit is None


def test_the_mean_section_of_rows_that_sample_elsewhere_bounds_a_ridge_with_sharp_edges_as_each_of_them() -> None:
    """Their mean blurs the arcs on which the ball rolls over the edges."""
    rng, tip, rows = np.random.default_rng(5), 2e-3, []
    for k in range(20):
        across = 0.042e-3 * (np.arange(-280, 280) + rng.uniform())
        edge = np.maximum(np.abs(across) - 0.5e-3, 0.0)
        height = np.maximum(0.2e-3 + np.sqrt(np.maximum(tip**2 - edge**2, 0.0)), tip) * (edge < tip)
        height = np.maximum(height, tip) + 1e-6 * rng.standard_normal(len(across))
        rows.append(np.column_stack([across, np.full(len(across), 1e-3 * k), height]))
    centers = np.concatenate(rows)
    raster = Trace(np.arange(len(centers)) * 1.0, centers, np.repeat(np.arange(20), len(centers) // 20), tip)
    base = fit_base(raster)
    found = detect(raster, base)
    sections = free_sections(found, LaidTrace.of(raster, base))[0]
    assert len(sections) == 20
    sizes = mean_sizes(sections, np.ones(20), tip, found.noise)
    assert sizes.least == pytest.approx(1e-3, rel=0.05)
    # the foot may reach as far as the ball's way to the base
    assert sizes.most == pytest.approx(1e-3 + 2.0 * np.sqrt(2.0 * tip * 0.2e-3 - 0.2e-3**2), rel=0.05)


@pytest.mark.slow
def test_a_line_that_widens_or_rises_says_so() -> None:
    def widening(x: FloatArray, y: FloatArray) -> FloatArray:
        return np.maximum(0.0, 1e-6 * (1.0 - (x / (12e-6 + 0.05 * y)) ** 2)) * (np.abs(y) < 90e-6)

    def rising(x: FloatArray, y: FloatArray) -> FloatArray:
        return np.maximum(0.0, (1.5e-6 + 0.012 * y) * (1.0 - (x / 12e-6) ** 2)) * (np.abs(y) < 90e-6)

    for form, name in ((widening, "width"), (rising, "height")):
        (found,) = felt(form, 11, 30e-9)
        assert found.kind == "ridge" and found.details.free_section
        assert f"its {name} varies along it" in found.details.misfit


@pytest.mark.parametrize("seed", range(4))
def test_the_same_row_again_tells_no_slant_of_a_wide_detail(seed: int) -> None:
    (found,) = felt(
        lambda x, _: -np.maximum(0.0, 1.5e-6 * (1.0 - np.abs(x) / 10e-6)), seed, 40e-9, rows=2, pitch=0.05e-6
    )
    assert found.kind == "pit" and found.details.free_section
    assert abs(found.width.median - 20e-6) < 2e-6


@pytest.mark.parametrize("degrees", [18.0, pytest.param(10.0, marks=pytest.mark.slow)])
@pytest.mark.slow
def test_a_wire_that_rows_cross_at_a_slant_is_no_wider_for_that(degrees: float) -> None:
    """The paper's wire, square to it felt over 7.2 mm: at 18 degrees each row feels it over 23 mm; at 10 over 41, but
    for those at its ends, which alone show something short."""
    tip, size, rng = 10e-3, 0.65e-3, np.random.default_rng(13)
    x = np.arange(-100e-3, 100e-3, 0.1e-3)
    places = np.concatenate([np.column_stack([x, np.full_like(x, y)]) for y in 2.5e-3 * np.arange(-5.5, 6.0)])
    along = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
    away = np.hypot(places @ [-along[1], along[0]], np.maximum(np.abs(places @ along) - 30e-3, 0.0))
    heights = tip + cap_height(away, size, 0.5 * size, tip) + 20e-6 * rng.standard_normal(len(places))
    raster = Trace(1e-3 * np.arange(len(places)), np.column_stack([places, heights]), np.repeat(range(12), len(x)), tip)
    base = fit_base(raster)
    (found,) = refine_all(assemble(detect(raster, base), raster, base), raster, 13, base=base)
    assert found.kind == "ridge" and not found.details.free_section and found.curvature_feature
    assert found.height.low < size < found.height.high and found.height.high - found.height.low < 20e-6
    assert found.width.low < size < found.width.high
    assert abs(found.length.median - 60e-3) < 0.5e-3


def test_a_line_to_the_rasters_border_is_at_least_so_long() -> None:
    (found,) = felt(lambda x, _: -np.maximum(0.0, 1e-6 * (1.0 - np.abs(x) / 8e-6)), 12, 50e-9)
    assert found.kind == "groove" and found.length.censored
    assert found.length.median == pytest.approx(13 * PITCH, rel=0.02)


def test_a_wide_hollow_no_longer_than_wide_is_a_pit_that_may_be_deeper_between_the_sweeps() -> None:
    def cone(x: FloatArray, y: FloatArray) -> FloatArray:
        return -2e-6 * np.maximum(0.0, 1.0 - np.hypot(x, y - 4e-6) / 25e-6)

    (found,) = felt(cone, 13, 50e-9)
    assert found.kind == "pit" and found.length.median == 0.0
    assert found.height.low < -2e-6 < found.height.high
    assert np.linalg.norm(found.axis[0, :2] - [0.0, 4e-6]) < 0.6 * PITCH


def test_a_bare_raster_holds_nothing_wide() -> None:
    assert not felt(lambda x, _: 0.0 * x, 14, 60e-9)


def assembled(
    height: Callable[[FloatArray, FloatArray], FloatArray], rows: FloatArray, *, level: bool = False
) -> list[Feature]:
    """What rows of a ball of 1 mm assemble to, whose centre is by so much higher than its radius; over a base of one
    `level` if that is asked for."""
    x = np.arange(-13e-3, 13e-3, 0.1e-3)
    feet = np.concatenate([np.column_stack([x[:: 1 - 2 * (k % 2)], np.full(len(x), y)]) for k, y in enumerate(rows)])
    z = height(*feet.T) + 3e-6 * np.random.default_rng(7).standard_normal(len(feet))
    sweep = np.repeat(np.arange(len(rows)), len(x))
    raster = Trace(1e-2 * np.arange(len(feet)), np.column_stack([feet, 1e-3 + z]), sweep, 1e-3)
    base = fit_base(raster)
    if level:
        base = replace(base, parameters={key: own for key, own in base.parameters.items() if key != "levels"})
    return list(assemble(detect(raster, base), raster, base))


def test_rivets_are_bumps_wherever_the_rows_pass() -> None:
    # a cap of 2.4 mm is felt over 2.9 mm, across the rows as along them
    def rivets(x: FloatArray, y: FloatArray) -> FloatArray:
        z = np.zeros_like(x)
        for at in (-8e-3, -3e-3, 2e-3, 7e-3):
            away = np.hypot(x - at, y + 6e-3)
            z = np.maximum(z, np.sqrt(np.maximum(3.55e-3**2 - away**2, 0.0)) - 3.25e-3)
        return z

    found = assembled(rivets, np.arange(-12.83e-3, 13e-3, 0.5e-3))
    assert [feature.kind for feature in found] == ["bump"] * 4


def test_keys_are_bumps_in_their_middles_whichever_row_is_the_highest() -> None:
    # on a flat top it is any of them by noise: at its rim, half of what lies about it seems to be no key
    def keys(x: FloatArray, y: FloatArray) -> FloatArray:
        away = np.min([np.maximum(abs(x - at), abs(y - 1e-3)) for at in (-5e-3, 0.0, 5e-3)], axis=0)
        return step_height(1.5e-3 - away, 0.25e-3, 1e-3)

    found = assembled(keys, np.arange(-12.83e-3, 13e-3, 0.5e-3), level=True)
    assert [feature.kind for feature in found] == ["bump"] * 3
    middles = np.sort([feature.axis[0, 0] for feature in found])
    assert middles == pytest.approx([-5e-3, 0.0, 5e-3], abs=0.1e-3)
    assert [feature.axis[0, 1] for feature in found] == pytest.approx([1e-3] * 3, abs=0.25e-3)


def test_a_dent_a_quarter_as_long_as_the_rows_is_one_pit() -> None:
    # of a raster; on a profile what is as deep for an eighth of it may be a level of its base
    def dented(x: FloatArray, y: FloatArray) -> FloatArray:
        dent = -0.15e-3 * np.exp(-((x - 5e-3) ** 2 + (y - 3e-3) ** 2) / (2.0 * 1.25e-3**2))
        slope = np.hypot(dent * (x - 5e-3), dent * (y - 3e-3)) / 1.25e-3**2
        return np.asarray(-(x**2) / 0.3 + dent + 0.5e-3 * slope**2)  # of a parallel surface, to the second order

    (found,) = assembled(dented, np.arange(-12.83e-3, 13e-3, 0.5e-3))
    assert found.kind == "pit"
    assert found.height.low < -0.15e-3 < found.height.high


@pytest.mark.slow
def test_a_bead_as_wide_as_the_ball_that_rises_and_falls_is_one_line() -> None:
    """Felt 1.42 to 1.58 times as wide as a crest: single sweeps of it are less wide than a detail is alone."""
    aside = np.linspace(-1e-3, 1e-3, 401)[:, None]

    def bead(x: FloatArray, y: FloatArray) -> FloatArray:
        high, half = (0.57 + 0.067 * np.sin(y / 3e-3)) * 1e-3, (1.0 + 0.1 * np.sin(y / 2.33e-3)) * 1e-3
        on = high * np.maximum(1.0 - ((x + aside) / half) ** 2, 0.0)
        return (on + np.sqrt(np.maximum(1e-6 - aside**2, 0.0)) - 1e-3).max(axis=0)

    rows = 0.67e-3 * np.arange(31)
    (ridge,) = assembled(bead, rows)
    assert ridge.kind == "ridge"
    assert np.ptp(ridge.axis[:, 1]) > rows[-2]
    assert ridge.evidence.crossings == len(rows)


def test_burrs_between_which_the_ball_sinks_by_less_than_a_sweep_tells_are_two_ridges() -> None:
    """30 um high and 0.26 mm apart: between them the ball of 1 mm sinks by 8 um, three times the noise of a sample."""

    def burrs(x: FloatArray, _: FloatArray) -> FloatArray:
        arcs = [np.sqrt(np.maximum(1e-6 - (x - at) ** 2, 0.0)) - 0.97e-3 for at in (-0.13e-3, 0.13e-3)]
        return np.maximum(np.maximum(*arcs), 0.0)

    one, other = assembled(burrs, 1.5e-3 * np.arange(12))
    assert one.kind == other.kind == "ridge"
    assert abs(abs(one.axis[0, 0] - other.axis[0, 0]) - 0.26e-3) < 0.03e-3


def test_a_ring_hardly_wider_than_it_is_felt_is_a_closed_ridge_under_rows_one_way() -> None:
    """Three rows of the ball of 1 mm feel both sides of a ring of 1.6 mm, a wire of 0.2 mm: crests as round a spot."""

    def ring(x: FloatArray, y: FloatArray) -> FloatArray:
        aside = np.hypot(x - 0.1e-3, y - 0.15e-3) - 0.8e-3
        return np.maximum(np.sqrt(np.maximum(1.1e-3**2 - aside**2, 0.0)) - 0.9e-3, 0.0)

    (told,) = assembled(ring, 0.64e-3 * np.arange(-8, 9))
    assert told.kind == "ridge" and told.closed
    assert told.height.low < 0.2e-3 < told.height.high


def over_cone(away: FloatArray, height: float, radius: float, tip: float) -> FloatArray:
    """Heights of the ball's path over a cone on a plane, at distances from its axis."""
    slope = height / radius
    beside = tip * slope / np.hypot(1.0, slope)  # of the tangent contact
    flank = height - slope * away + tip * (np.hypot(1.0, slope) - 1.0)
    apex = height - tip + np.sqrt(np.maximum(tip**2 - np.minimum(away, beside) ** 2, 0.0))
    return np.maximum(np.where(away < beside, apex, flank), 0.0)


def test_a_cone_whose_tip_lies_between_two_rows_is_as_high_as_all_rows_say() -> None:
    """The highest row was 0.109 mm high (0.108 to 0.110) of 0.15, and one at its foot a bump of its own."""
    rng, tip = np.random.default_rng(3), 1e-3
    x, y = np.arange(0.0, 20e-3, 1e-4), np.arange(0.0, 6e-3, 0.8e-3)
    u, v = (grid.ravel() for grid in np.meshgrid(x, y))
    z = tip + over_cone(np.hypot(u - 9.7e-3, v - 2.8e-3), 0.15e-3, 1.2e-3, tip) + rng.normal(0.0, 1e-6, len(u))
    raster = Trace(1e-3 * np.arange(len(u)), np.column_stack([u, v, z]), np.repeat(np.arange(len(y)), len(x)), tip)
    base = fit_base(raster)
    (found,) = refine_all(assemble(detect(raster, base), raster, base), raster, 0, base=base)
    assert found.kind == "bump"
    assert found.height.low < 0.15e-3 < found.height.high
    assert found.width.median == pytest.approx(2.4e-3, rel=0.02)


def test_what_rows_begin_and_end_on_is_no_feature() -> None:
    """A plate's rim: each row rolls off it at both of its ends, which was told as two grooves, 1.1 and 0.85 mm wide."""
    rng, tip, rim = np.random.default_rng(4), 1e-3, 0.25e-3
    x, y = np.arange(-5e-3, 5e-3, 5e-5), np.arange(0.0, 6e-3, 0.8e-3)
    u, v = (grid.ravel() for grid in np.meshgrid(x, y))
    off = np.maximum(np.abs(u) - (5e-3 - rim), 0.0)
    z = np.sqrt(tip**2 - off**2) + rng.normal(0.0, 1e-6, len(u))
    raster = Trace(1e-3 * np.arange(len(u)), np.column_stack([u, v, z]), np.repeat(np.arange(len(y)), len(x)), tip)
    base = fit_base(raster)
    detections = detect(raster, base)
    assert len(detections.crossings) >= 2 * len(y) - 2
    assert assemble(detections, raster, base) == ()
