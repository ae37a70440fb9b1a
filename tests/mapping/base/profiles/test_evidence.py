"""The evidence by which a profile's base is chosen: most places lie on it, some stand off it by anything."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import norm

from mapping import FloatArray, Trace
from mapping.base import Base, fit_base
from mapping.base.profiles.evidence import Scatter

TIP = 50e-6
X = 2e-6 * np.arange(6000)


def base_of(body: FloatArray, rough: float) -> Base:
    """Of a profile that is as high as the body (the ball's rounding of its edges is of no account here)."""
    rng = np.random.default_rng(11)
    kernel = np.exp(-0.5 * (np.arange(-60, 61) / 15.0) ** 2)
    roughness = rough * np.convolve(rng.standard_normal(len(X)), kernel / np.linalg.norm(kernel), "same")
    return fit_base(Trace.from_profile(X, body + roughness + 5e-7 * rng.standard_normal(len(X)) + TIP, TIP))


def thread(pitch: float, depth: float) -> FloatArray:
    """Flats with a V between each two, half a pitch wide."""
    return np.asarray(-np.maximum(0.0, depth * (1.0 - 4.0 * np.abs(X % pitch - 0.5 * pitch) / pitch)))


@pytest.mark.parametrize("rough", [0.0, 2e-6])
@pytest.mark.parametrize(("pitch", "depth"), [(1.25e-3, 0.54e-3), (0.5e-3, 0.2e-3)])
def test_half_of_a_threads_profile_lies_on_a_line_that_the_other_half_does_not_bend(
    pitch: float, depth: float, rough: float
) -> None:
    base = base_of(0.01 * X + thread(pitch, depth), rough)
    assert base.parameters["degree"] == 1 and len(base.levels) == 1


def test_the_base_is_the_level_that_most_lies_on_though_the_most_is_no_half() -> None:
    """A metric thread: an eighth of each pitch is a crest, a quarter a root, the rest flanks."""
    at = np.abs(X / 1.25e-3 % 1.0 - 0.5)
    base = base_of(0.01 * X - 0.68e-3 * np.clip((0.4375 - at) / (0.4375 - 0.125), 0.0, 1.0), 0.0)
    middle = base.surface.vertices[len(base.surface.vertices) // 2 :]
    assert middle[:, 2] - 0.01 * middle[:, 0] == pytest.approx(-0.68e-3, abs=2e-6)
    assert base.parameters["on_base"] == pytest.approx(0.25, abs=0.05)


@pytest.mark.parametrize("rough", [0.0, 2e-6])
@pytest.mark.parametrize(("begins", "ends"), [(None, 11.3e-3), (0.7e-3, 11.3e-3), (None, None)])
def test_ends_that_leave_the_base_for_good_are_told(rough: float, begins: float | None, ends: float | None) -> None:
    """A chamfer, or the flank of a groove that the end cuts; a groove that ends before it is none."""
    body = np.zeros_like(X) if begins is None else 0.5 * np.maximum(0.0, begins - X)
    body -= 0.0 if ends is None else 0.5 * np.maximum(0.0, X - ends)
    body -= 0.1e-3 * (np.abs(X - 11.0e-3) < 0.2e-3)
    told = base_of(body, rough).parameters.get("open_ends", [])
    at = [place for place in (begins, ends) if place is not None]
    assert isinstance(told, list) and [end["from"][0] for end in told] == pytest.approx(at, abs=0.05e-3)
    assert [np.sign(end["height"]) for end in told] == [np.sign(0.5 - (place > 1e-3)) for place in at]


def test_a_drop_before_the_end_is_a_level_and_no_open_end() -> None:
    base = base_of(-0.3e-3 * (X > 11.5e-3), 2e-6)
    assert base.levels == pytest.approx([0.0, -0.3e-3], abs=2e-6) and "open_ends" not in base.parameters


@pytest.mark.parametrize("rough", [0.0, 2e-6])
def test_roughness_is_no_form(rough: float) -> None:
    """A curve that is free to follow it had sixteen pieces: each place counted as if it were alone."""
    base = base_of(-((X - 6e-3) ** 2) / 60e-3, rough)
    assert (base.parameters["degree"], base.parameters["pieces"]) == (2, 1)


def test_what_bends_all_along_is_form() -> None:
    assert base_of(50e-6 * np.sin(2.0 * np.pi * X / 6e-3), 2e-6).parameters["pieces"] >= 8


def test_the_misfit_of_noise_alone_is_that_of_a_normal_law_and_details_cost_their_span() -> None:
    noise = 3e-6 * np.random.default_rng(2).standard_normal(2000)
    scatter = Scatter(1e-6, 1e-3, 1.0)
    alone = len(noise) * (1.0 + np.log(2.0 * np.pi * np.mean(noise**2)))
    assert scatter.misfit(noise) == pytest.approx(alone, abs=1.0)
    far = np.concatenate([noise, np.linspace(-5e-4, 5e-4, 1000)])
    sds, offs = np.linspace(2.8e-6, 3.2e-6, 41), np.linspace(0.3, 0.36, 31)
    likeliest = min(
        -2.0 * np.log((1.0 - off) * norm.pdf(far, scale=sd) + off / scatter.span).sum() for sd in sds for off in offs
    )
    assert scatter.misfit(far) == pytest.approx(likeliest, abs=0.1)
    assert scatter.share_on(far) == pytest.approx(2 / 3, abs=0.01)


@pytest.mark.parametrize("noise", [0.0, 5e-7])
def test_most_of_a_bare_profile_lies_on_its_base(noise: float) -> None:
    bare = 0.01 * X + noise * np.random.default_rng(1).standard_normal(len(X))
    base = fit_base(Trace.from_profile(X, bare + TIP, TIP))
    assert base.parameters["on_base"] > 0.75 and "open_ends" not in base.parameters


def test_places_that_deviate_alike_count_once() -> None:
    """Of a correlation exp(-k / 8) from place to place the sum over all lags is coth(1 / 16)."""
    step = np.exp(-1.0 / 8.0)
    alike = lfilter([np.sqrt(1.0 - step**2)], [1.0, -step], np.random.default_rng(3).standard_normal(50_000))
    assert Scatter.left_by(alike, 0.1, 100.0).places == pytest.approx(1.0 / np.tanh(1.0 / 16.0), rel=0.1)
    white = np.random.default_rng(4).standard_normal(50_000)
    assert Scatter.left_by(white, 0.1, 100.0).places == 1.0
