"""The form of a profile, as its user says it or the evidence chooses it."""

from __future__ import annotations

import numpy as np
import pytest

from mapping import FloatArray, FormError, Trace
from mapping.base import Base, Form, LaidTrace, fit_base
from mapping.base.profiles.isolated_bends import isolated_bends
from mapping.detection import detect

TIP, RADIUS = 2e-6, 40e-3
DEEP, WIDE = 50e-6, 90e-6
X = np.arange(0.0, 4.8e-3, 1e-6)


def line_of(base: Base, x: FloatArray = X) -> FloatArray:
    """Height of the base's own trace, m."""
    left = base.surface.vertices[: len(base.surface.vertices) // 2]
    return np.asarray(np.interp(x, left[:, 0], left[:, 2]) + TIP)


def base_error(form: Form, curved: bool) -> float:
    """Greatest error of the base under a scratch, m."""
    line = 0.002 * X - (RADIUS - np.sqrt(RADIUS**2 - (X - 2.4e-3) ** 2) if curved else 0.0)
    scratch = DEEP * np.clip(1 - ((X - 2e-3) / (WIDE / 2)) ** 2, 0.0, None)
    noise = 2e-7 * np.random.default_rng(5).standard_normal(len(X))
    base = fit_base(Trace.from_profile(X, line - scratch + noise, TIP), form=form)
    return float(np.abs(line_of(base) - line).max())


@pytest.mark.parametrize(
    ("form", "curved", "error"),
    [("line", False, 1e-7), ("arc", True, 3e-7), ("poly:2", True, 3e-7), ("gaussian:0.8mm", True, 1e-6)],
)
def test_a_form_leaves_a_scratch_in_the_profile(form: str, curved: bool, error: float) -> None:
    assert base_error(Form.read(form), curved) < error


def test_no_form_is_a_level_line() -> None:
    base = fit_base(Trace.from_profile(X, np.full_like(X, 3e-6), TIP), form=Form.read("none"))
    assert line_of(base) == pytest.approx(3e-6, abs=1e-12)


@pytest.mark.parametrize(("share", "passes"), [(0.5, 0.0625), (1.0, 0.5), (2.0, 0.841)])
def test_the_gaussian_passes_of_a_wave_what_iso_16610_21_says(share: float, passes: float) -> None:
    """exp(-pi (alpha cutoff / wavelength)^2), alpha = sqrt(ln 2 / pi); a robust filter differs by a few per cent."""
    cutoff, wave = 0.4e-3, 1e-6 * np.sin(2 * np.pi * X / (share * 0.4e-3))
    line = line_of(fit_base(Trace.from_profile(X, wave, TIP), form=Form.read(f"gaussian:{cutoff}m")))
    inside = np.abs(X - 0.5 * X[-1]) < 0.5 * X[-1] - cutoff
    found = 2 * np.mean(line[inside] * np.sin(2 * np.pi * X[inside] / (share * cutoff))) / 1e-6
    assert found == pytest.approx(passes, abs=0.06)


def test_a_slope_stays_a_slope_up_to_the_ends_under_a_gaussian() -> None:
    line = line_of(fit_base(Trace.from_profile(X, 0.01 * X, TIP), form=Form.read("gaussian:0.8mm")))
    assert line == pytest.approx(0.01 * X, abs=TIP * 1e-3)


def test_a_masked_stretch_does_not_bend_the_base() -> None:
    """A step over a third of a profile: a line through all of it is tilted, one that leaves it out is not."""
    step = 20e-6 * (X > 2.6e-3)
    whole, masked = (
        line_of(fit_base(Trace.from_profile(X, step, TIP), form=Form.read("poly:1", masks)))
        for masks in ((), ("2.5 mm..5mm",))
    )
    assert np.abs(masked).max() < 1e-9
    assert np.abs(whole).max() > 1e-6


@pytest.mark.parametrize(
    "text", ["poly", "poly:0", "poly:99", "gaussian", "gaussian:-1mm", "gaussian:x", "gaussian:0.8", "circle", ""]
)
def test_a_form_that_there_is_not_is_refused_with_those_that_there_are(text: str) -> None:
    with pytest.raises(FormError, match="possible: auto, line, arc"):
        Form.read(text)


@pytest.mark.parametrize("text", ["1mm", "2mm..1mm", "1..2", "a..b", ".."])
def test_a_mask_that_is_no_stretch_is_refused(text: str) -> None:
    with pytest.raises(FormError, match=r"possible: FROM\.\.TO"):
        Form.read("line", (text,))


def test_masks_that_leave_nothing_are_refused() -> None:
    with pytest.raises(FormError, match=r"masks .* leave 0$"):
        fit_base(Trace.from_profile(X, np.zeros_like(X), TIP), form=Form.read("line", ("-1mm..9mm",)))


def test_a_wavelength_longer_than_the_profile_is_refused() -> None:
    with pytest.raises(FormError, match="length of the profile"):
        fit_base(Trace.from_profile(X, np.zeros_like(X), TIP), form=Form.read("gaussian:80mm"))


# (waviness m, its wavelength m, noise m, samples): the bends were looked for on other seeds than these
WORLDS = ((1e-6, 0.5e-3, 1e-7, 4800), (2e-6, 0.2e-3, 2e-7, 4800), (5e-6, 0.25e-3, 1e-7, 2000), (0.0, 1.0, 5e-7, 600))


@pytest.mark.parametrize("seed", [300, 301, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (302, 303, 304))])
@pytest.mark.parametrize("world", WORLDS)
def test_a_scratch_is_found_or_said(world: tuple[float, float, float, int], seed: int) -> None:
    wavy, wavelength, noise, samples = world
    rng = np.random.default_rng(seed)
    x = 1e-6 * np.arange(samples)
    place = rng.uniform(0.3, 0.7) * x[-1]
    body = (
        0.002 * x - (x - x.mean()) ** 2 / (2 * RADIUS) + wavy * np.sin(2 * np.pi * x / wavelength + rng.uniform(0, 6))
    )
    z = body - DEEP * np.clip(1 - ((x - place) / (WIDE / 2)) ** 2, 0.0, None) + noise * rng.standard_normal(samples)
    trace = Trace.from_profile(x, z, TIP)
    base = fit_base(trace)
    said = [
        bend
        for name in ("absorbed", "left standing")
        for bend in base.parameters.get(name, ())
        if abs(bend["place"][0] - place) < 0.2 * WIDE
        and bend["height"] == pytest.approx(-DEEP, rel=0.15)
        and bend["width"] == pytest.approx(WIDE / np.sqrt(2), rel=0.25)
    ]
    found = [
        crossing
        for crossing in detect(LaidTrace.of(trace, base), base).crossings
        if abs(crossing.point[0] - place) < WIDE and crossing.height < -0.5 * DEEP
    ]
    assert said or found


@pytest.mark.parametrize("seed", range(310, 316))
def test_form_alone_is_not_said_to_be_absorbed(seed: int) -> None:
    rng = np.random.default_rng(seed)
    wave = 2e-6 * np.sin(2 * np.pi * X / 0.5e-3 + rng.uniform(0, 6)) + 5e-6 * np.cos(X / 1e-3)
    base = fit_base(Trace.from_profile(X, wave + 1e-7 * rng.standard_normal(len(X)), TIP))
    assert not {"absorbed", "left standing"} & set(base.parameters)


def test_a_line_that_swings_away_from_the_profile_is_no_bend_of_it() -> None:
    x, z = np.arange(100.0), -0.1 * np.cos(np.arange(100.0))
    line = z + np.where((x > 40) & (x < 46), 9.0, 0.0)
    z[(x > 40) & (x < 46)] = [-3.0, -9.0, -2.0, -9.0, -3.0]
    assert isolated_bends(x, z, line, 0.1) == []
