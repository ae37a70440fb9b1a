"""Details of a profile much wider than the tip: measured on the trace as it is, whatever their form."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.ndimage import grey_dilation
from scipy.optimize import isotonic_regression

from mapping import Feature, FloatArray, Trace
from mapping.assembly import assemble
from mapping.assembly.free import outline
from mapping.base import fit_base
from mapping.detection import detect
from mapping.inference import refine_all

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


@pytest.mark.parametrize("count", [1, 2, 60, 500])
def test_a_monotone_outline_is_the_isotonic_regression(count: int) -> None:
    rng = np.random.default_rng(count)
    values = np.linspace(0.0, 2.0, count) + rng.normal(size=count)
    np.testing.assert_allclose(outline._rising(values), isotonic_regression(values).x, atol=1e-14)
    falling = outline._rising(values[::-1])[::-1]
    np.testing.assert_allclose(falling, isotonic_regression(values, increasing=False).x, atol=1e-14)
