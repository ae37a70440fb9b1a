"""Details of a profile much wider than the tip: measured on the trace as it is, whatever their form."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.ndimage import grey_dilation

from mapping import Feature, FloatArray, Interval, Trace
from mapping.assembly import assemble
from mapping.assembly.free.outline import of_all_scales, outlined
from mapping.assembly.free.sizes import sizes_of_section
from mapping.base import SweepHeights, fit_base
from mapping.detection import detect
from mapping.inference.joint import refine_all
from mapping.instrument import Noise

TIP, FINE, SAMPLING = 2e-6, 0.04e-6, 25
Form = Callable[[FloatArray], FloatArray]


def felt(form: Form, seed: int, noise: float = 30e-9) -> tuple[Feature, ...]:
    """What is found on 4 mm of a slightly tilted profile with a detail at 2 mm, its trace by brute-force dilation."""
    x = FINE * np.arange(100_000)
    reach = int(TIP / FINE)
    ball = np.sqrt(TIP**2 - (FINE * np.arange(-reach, reach + 1)) ** 2) - TIP
    trace = grey_dilation(form(x - 2e-3), structure=ball, mode="nearest")[::SAMPLING]
    rng = np.random.default_rng(seed)
    x = x[::SAMPLING]
    heights = trace + 2e-3 * x + noise * rng.standard_normal(len(x))
    profile = Trace.from_profile(x, heights + TIP, TIP)
    base = fit_base(profile)
    features = refine_all(assemble(detect(profile, base), profile, base), profile, seed, base=base)
    return tuple(feature for feature in features if feature.evidence.likely)


def scratch(u: FloatArray) -> FloatArray:
    return -np.maximum(0.0, 12e-6 * (1.0 - np.abs(u) / 30e-6))


def slot(u: FloatArray) -> FloatArray:
    return np.where(np.abs(u) < 50e-6, -20e-6, 0.0)


def hump(u: FloatArray) -> FloatArray:
    return np.maximum(0.0, 8e-6 * (1.0 - (u / 20e-6) ** 2))


def mesa(u: FloatArray) -> FloatArray:
    return np.clip(10e-6 * (1.5 - np.abs(u) / 40e-6), 0.0, 10e-6)


@pytest.mark.parametrize(
    ("form", "height", "width", "doubt"),
    [
        (scratch, -12e-6, 60e-6, 2e-6),
        (slot, -20e-6, 100e-6, 3e-6),
        (hump, 8e-6, 40e-6, 5e-6),
        (mesa, 10e-6, 120e-6, 3e-6),
    ],
)
@pytest.mark.parametrize("seed", [0, 1])
def test_a_wide_detail_of_any_form_is_one_with_its_sizes(
    form: Form, height: float, width: float, doubt: float, seed: int
) -> None:
    (found,) = felt(form, seed)
    assert found.kind == ("bump" if height > 0.0 else "pit") and found.details.free_section
    # twice the half-width of the interval: two tests in a hundred would fail by chance at the interval itself
    for size, true in ((found.height, height), (found.width, width)):
        spread = size.high - size.low
        assert size.median - spread < true < size.median + spread
    assert found.width.high - found.width.low < doubt
    assert abs(found.height.median - height) < 0.3e-6
    assert abs(found.axis[0, 0] - 2e-3) < 1.0e-6
    assert found.evidence.likely


@pytest.mark.parametrize("wide", [4e-3, pytest.param(12e-3, marks=pytest.mark.slow)])
def test_a_wide_detail_may_be_a_large_part_of_its_profile(wide: float) -> None:
    """A notch of 4 mm, or of 12, in 30 mm that a ball of 1 mm was drawn over: no level is so slanted."""
    tip, fine = 0.5e-3, 5e-6
    grid, x = fine * np.arange(6000), 50e-6 * np.arange(600)
    ball = np.sqrt(tip**2 - (fine * np.arange(-99, 100)) ** 2) - tip
    notch = -1e-3 * np.maximum(0.0, 1.0 - np.abs(grid - 13e-3) / (0.5 * wide))
    heights = np.interp(x, grid, grey_dilation(notch, structure=ball, mode="nearest"))
    heights += 2e-6 * np.random.default_rng(2).standard_normal(len(x))
    profile = Trace.from_profile(x, heights + tip, tip)
    base = fit_base(profile)
    (found,) = assemble(detect(profile, base), profile, base)
    assert found.kind == "pit" and found.details.free_section
    assert found.width.low - 20e-6 < wide < found.width.high + 20e-6
    assert found.height.low - 10e-6 < -1e-3 < found.height.high + 10e-6


@pytest.mark.slow
def test_an_edge_is_no_part_of_a_groove_on_its_terrace() -> None:
    """However far the terrace reaches that it was compared with."""
    tip, fine = 1e-3, 5e-6
    grid = fine * np.arange(6000)
    ball = np.sqrt(tip**2 - (fine * np.arange(-199, 200)) ** 2) - tip
    body = -1.3e-3 * np.maximum(0.0, 1.0 - np.abs(grid - 7.5e-3) / 2.1e-3) - np.where(grid > 21e-3, 0.8e-3, 0.0)
    heights = grey_dilation(body, structure=ball, mode="nearest")[::4]
    heights += 8e-6 * np.random.default_rng(2).standard_normal(len(heights))
    profile = Trace.from_profile(grid[::4], heights + tip, tip)
    base = fit_base(profile)
    found = assemble(detect(profile, base), profile, base)
    assert sorted(feature.kind for feature in found) == ["pit", "step"]


@pytest.mark.parametrize(("depth", "width"), [(1.2e-6, 16e-6), (0.5e-6, 9e-6), (2e-6, 30e-6)])
@pytest.mark.parametrize("share", [0.04, 0.08])
def test_a_faint_scratch_is_read_in_bins_as_wide_as_its_noise_asks_for(
    depth: float, width: float, share: float
) -> None:
    def faint(u: FloatArray) -> FloatArray:
        return -np.maximum(0.0, depth * (1.0 - 2.0 * np.abs(u) / width))

    (found,) = felt(faint, 7, share * depth)
    assert found.kind == "pit" and found.details.free_section
    for size, true in ((found.height, -depth), (found.width, width)):
        spread = size.high - size.low
        assert size.median - spread < true < size.median + spread
    assert abs(found.height.median + depth) < 0.25 * depth
    assert found.width.low > 0.0 and abs(found.width.median - width) < 0.35 * width


def test_a_scratch_with_burrs_is_three_details() -> None:
    def burred(u: FloatArray) -> FloatArray:
        return scratch(u) + 5e-6 * sum(np.exp(-0.5 * ((u - side * 50e-6) / 8e-6) ** 2) for side in (-1, 1))

    found = felt(burred, 2)
    assert [feature.kind for feature in found] == ["pit", "bump", "bump"]
    assert all(abs(feature.height.median - 5e-6) < 0.2e-6 for feature in found[1:])


def test_what_stands_on_the_floor_of_a_wide_hollow_is_a_detail_of_its_own() -> None:
    def with_wire(u: FloatArray) -> FloatArray:
        return np.maximum(slot(u), np.where(np.abs(u) < 0.5e-6, -18e-6, -1.0))

    pit, wire = felt(with_wire, 3)
    assert (pit.kind, wire.kind) == ("pit", "bump") and pit.details.free_section
    assert abs(wire.height.median - 2e-6) < 0.3e-6 and abs(wire.axis[0, 0] - 2e-3) < 1e-6


@pytest.mark.slow
def test_a_step_through_which_the_base_was_drawn_stays_a_step() -> None:
    found = felt(lambda u: np.where(u > 0.0, 4.6e-6, 0.0), 4)
    assert [feature.kind for feature in found] == ["step"] and not found[0].details.free_section


@pytest.mark.slow
def test_of_a_rack_the_teeth_are_as_high_and_as_wide_as_they_are() -> None:
    """Its roots, two fifths of it, are the base: what they scatter by is not the others' height."""

    def rack(u: FloatArray) -> FloatArray:
        away = np.abs((u / 400e-6 + 0.5) % 1.0 - 0.5)
        return np.asarray(-50e-6 * np.clip((0.35 - away) / 0.15, 0.0, 1.0))

    found = felt(rack, 3)
    assert len(found) == 10 and {feature.kind for feature in found} == {"bump"}
    for feature in found:
        assert feature.height.median == pytest.approx(50e-6, abs=0.1e-6)
        assert feature.width.median == pytest.approx(240e-6, abs=1e-6) and feature.details.misfit is None


def test_rough_and_bare_profiles_hold_none() -> None:
    assert felt(lambda u: 0.0 * u, 5) == ()


def test_a_doubtful_tip_makes_the_width_doubtful() -> None:
    x = FINE * np.arange(100_000)
    reach = int(TIP / FINE)
    ball = np.sqrt(TIP**2 - (FINE * np.arange(-reach, reach + 1)) ** 2) - TIP
    heights = grey_dilation(slot(x - 2e-3), structure=ball)[::SAMPLING]
    noise = 1e-8 * np.random.default_rng(6).standard_normal(len(heights))
    profile = Trace.from_profile(x[::SAMPLING], heights + noise, TIP)
    base = fit_base(profile)
    found = assemble(detect(profile, base), profile, base)
    (sure,), (doubtful,) = (refine_all(found, profile, 0, base=base, tip_sd=sd) for sd in (0.0, 0.5e-6))
    assert sure.width.median == doubtful.width.median
    assert doubtful.width.high - doubtful.width.low > sure.width.high - sure.width.low + 0.5e-6


@pytest.mark.slow
def test_what_a_helix_feels_all_round_a_body_is_remarked_as_no_spot() -> None:
    radius, tip, fine = 0.03, 2e-3, 5e-6
    z = np.arange(-5e-3, 30e-3, fine)
    ring = np.where(np.abs(z - 12e-3) < 0.5e-3, 0.2e-3 * np.cos(np.pi * (z - 12e-3) / 1e-3), 0.0)
    ball = np.sqrt(tip**2 - np.arange(-tip + fine, tip, fine) ** 2) - tip
    felt_over = grey_dilation(ring, structure=ball, mode="nearest")
    turned = np.arange(0.0, 2.0 * np.pi * 16.0, 0.02)
    along = 1.5e-3 * turned / (2.0 * np.pi)
    out = radius + tip + np.interp(along, z, felt_over) + 4e-6 * np.random.default_rng(4).standard_normal(len(turned))
    centers = np.column_stack([out * np.cos(turned), out * np.sin(turned), along])
    trace = Trace(1e-3 * np.arange(len(turned)), centers, np.zeros(len(turned), dtype=int), tip)
    base = fit_base(trace)
    spots = [each for each in assemble(detect(trace, base), trace, base) if each.width.median > 2.0 * radius]
    assert spots and all("faces the other way" in str(each.details.misfit) for each in spots)


def bar(u: FloatArray) -> FloatArray:
    return np.where(np.abs(u) < 1.1e-3, 0.44e-3, 0.0)


def rounded(u: FloatArray) -> FloatArray:
    """The same with edges of 0.2 mm, and fillets of as much at its foot."""
    out, a = np.abs(u) - 0.9e-3, 0.2e-3
    top = 0.24e-3 + np.sqrt(np.clip(a**2 - np.clip(out, 0.0, None) ** 2, 0.0, None))
    foot = a - np.sqrt(np.clip(a**2 - np.clip(2.0 * a - out, 0.0, None) ** 2, 0.0, None))
    return np.where(out <= a, top, np.where(out < 2.0 * a, foot, 0.0))


def gentle(u: FloatArray) -> FloatArray:
    return np.clip(0.44e-3 * (1.5 - np.abs(u) / 1.1e-3), 0.0, 0.44e-3)


@pytest.mark.parametrize(("form", "low", "high"), [(bar, 2.2e-3, 2.2e-3), (rounded, 2.2e-3, 2.6e-3)])
@pytest.mark.parametrize("noise", [1e-6, 20e-6])
def test_of_walls_that_the_ball_did_not_touch_the_width_is_between_bounds(
    form: Form, low: float, high: float, noise: float
) -> None:
    width = of_one_section(form, noise)
    assert width.bounded and width.low < low and high < width.high < 4.2e-3
    if form is bar:  # the ball leaves an edge at sqrt(H (2 r - H)) beside it
        assert width.median == pytest.approx(2.2e-3, abs=0.03e-3 + 2.0 * (width.median - width.low))
        assert 2.2e-3 + 2.0 * 0.828e-3 < width.high < 3.95e-3 + 15.0 * noise


def test_of_flanks_that_it_went_down_on_the_width_is_a_number() -> None:
    width = of_one_section(gentle, 1e-6)
    assert not width.bounded and width.low < 3.3e-3 < width.high and width.high - width.low < 0.2e-3


def bead(u: FloatArray) -> FloatArray:
    """A parabola as wide as the ball, at whose foot this touches nothing."""
    return np.clip(0.6e-3 * (1.0 - (u / 1.1e-3) ** 2), 0.0, None)


def cap(u: FloatArray) -> FloatArray:
    """As high and wide, round."""
    radius = (1.1e-3**2 + 0.6e-3**2) / 1.2e-3
    return np.clip(np.sqrt(np.clip(radius**2 - u**2, 0.0, None)) - radius + 0.6e-3, 0.0, None)


@pytest.mark.parametrize("form", [bead, cap])
def test_a_round_foot_that_the_ball_did_not_touch_is_no_tangents_foot(form: Form) -> None:
    width = of_one_section(form, 1e-6)
    assert width.low < 2.2e-3 < width.high
    assert width.median == pytest.approx(2.2e-3, rel=0.07)  # by the tangents 2.41 and 2.55 mm


def of_one_section(form: Form, noise: float) -> Interval:
    """The width under a ball of 1 mm, in bins of 0.05 mm."""
    x = 2e-6 * np.arange(-2500, 2501)
    ball = np.sqrt(1e-6 - (2e-6 * np.arange(-499, 500)) ** 2) - 1e-3
    z = grey_dilation(form(x), structure=ball, mode="nearest")[::25]
    z += noise * np.random.default_rng(3).standard_normal(len(z))
    index, nowhere = np.arange(len(z) + 1), np.zeros((len(z), 3))
    piece = SweepHeights(0, -5e-3, 50e-6, z, 1.0, index, np.zeros(len(z)), nowhere)
    section = outlined(piece, 1.0, 60, 140, max(noise, 1e-6), np.inf)
    assert section is not None
    sizes = sizes_of_section(section, 1e-3, Noise(noise))
    assert sizes is not None
    return sizes.width_interval()


def piece_of(form: Form, noise: float = 1e-6) -> SweepHeights:
    """A ball of 1 mm over 30 mm with a detail in the middle, in bins of 0.1 mm."""
    fine = np.arange(-15e-3, 15e-3, 1e-5)
    ball = np.sqrt(1e-6 - np.arange(-1e-3, 1e-3, 1e-5) ** 2) - 1e-3
    felt = grey_dilation(form(fine), structure=ball, mode="nearest")[5::10]
    s = fine[5::10]
    heights = felt + noise * np.random.default_rng(4).standard_normal(len(s))
    centers = np.column_stack([s, 0.0 * s, heights + 1e-3])
    return SweepHeights(0, 0.0, 1e-4, heights, 1.0, np.arange(len(s) + 1), s, centers)


@pytest.mark.parametrize(
    ("form", "wide"),
    [
        # crests of 0.1 mm side by side, each as wide as a ball over a wire; with a bar instead of what lies between
        (lambda u: np.where(np.abs(np.abs(u) - 0.35e-3) < 3e-5, 1e-4, 0.0), 0),
        (lambda u: np.where(np.abs(u) < 0.38e-3, 1e-4, 0.0), 1),
        # a bar with a scratch across it is a bar
        (lambda u: np.where(np.abs(u) < 1.2e-3, np.where(np.abs(u) < 0.1e-3, 0.0, 1e-4), 0.0), 1),
    ],
)
def test_crests_side_by_side_are_no_wide_detail(form: Form, wide: int) -> None:
    assert len(of_all_scales(piece_of(form), 1e-3)) == wide
