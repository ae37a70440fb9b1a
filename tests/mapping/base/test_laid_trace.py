"""A trace on its base: each sample is laid once, and what is read from it is what laying it anew would give."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from mapping.base.base import Base, Feet
from mapping.base.height_profile import arclength, height_profiles
from mapping.base.laid_trace import LaidTrace
from mapping.surface import Surface
from mapping.trace import Trace

TIP = 5e-3
CORNERS = 0.05 * np.array([[-1.0, -1, 0], [1, -1, 0.2], [1, 1, 0], [-1, 1, 0.2]])


class Counted(Base):
    """A base that counts the points laid on it."""

    points = 0

    def foot(self, centers, tip_radius):  # type: ignore[no-untyped-def]
        type(self).points += len(centers)
        return super().foot(centers, tip_radius)


@pytest.fixture
def base() -> Base:
    Counted.points = 0
    return Counted(Surface(CORNERS, [[0, 1, 2], [0, 2, 3]]))


def sweeps(count: int = 3, first: int = 0) -> Trace:
    rng = np.random.default_rng(first)
    x = np.tile(np.linspace(-0.02, 0.02, 400), count)
    y = np.repeat(np.linspace(-0.01, 0.01, count), 400)
    centers = np.column_stack([x, y, 8e-3 + 1e-4 * rng.normal(size=len(x))])
    return Trace(np.arange(float(len(x))), centers, first + np.repeat(np.arange(count), 400), TIP)


def same(found: Feet, wanted: Feet) -> bool:
    return all(np.array_equal(getattr(found, each.name), getattr(wanted, each.name)) for each in fields(Feet))


def test_a_sample_is_laid_on_the_base_the_first_time_that_it_is_asked_for_and_never_again(base):
    trace = sweeps()
    laid = LaidTrace(trace, base)
    assert Counted.points == 0
    some = np.array([3, 17, 399, 400, 900])
    assert same(laid.feet(some), base.foot(trace.centers[some], TIP))
    Counted.points = 0
    laid.feet(some)
    laid.feet(np.array([17, 18]))
    assert Counted.points == 1
    assert same(laid.feet(), Base(base.surface).foot(trace.centers, TIP))
    assert Counted.points == len(trace) - len(some)


def test_arclengths_and_heights_are_those_of_the_sweep_alone_and_are_kept(base):
    laid = LaidTrace(sweeps(), base)
    for sweep in laid.laid_sweeps:
        s = arclength(sweep.trace, base)
        assert np.array_equal(sweep.arclength, s)
        for spacing in (1e-4, 5e-4, 5e-3):  # bins of one sample, of a few, of many
            (found,), (alone,) = (
                sweep.heights(spacing),
                height_profiles(sweep.number, sweep.trace, s, base, spacing),
            )
            assert np.array_equal(found.centers, alone.centers)
            # means of what is known already have other last digits
            assert np.allclose(found.height, alone.height, rtol=0, atol=1e-15)
            if found.feet is not None:
                assert np.allclose(found.feet, base.foot(found.centers, TIP).points, rtol=0, atol=1e-15)
    Counted.points = 0
    assert [sweep.heights(5e-4) for sweep in laid.laid_sweeps] and Counted.points == 0


@pytest.mark.parametrize("known", [False, True])
def test_heights_are_those_in_the_middle_of_bins_that_no_whole_number_of_steps_fits_into(known):
    corners = np.array([[-0.05, -0.01, 0.0], [0.05, -0.01, 0.0], [0.05, 0.01, 0.0], [-0.05, 0.01, 0.0]])
    plate = Base(Surface(corners, np.array([[0, 1, 2], [0, 2, 3]])))
    x = np.arange(-0.02, 0.02, 40e-6)
    crest = 1e-4 * np.exp(-0.5 * (x / 5e-4) ** 2)
    centers = np.column_stack([x, 0.0 * x, TIP + crest])
    laid = LaidTrace(Trace(np.arange(float(len(x))), centers, np.zeros(len(x), dtype=int), TIP), plate)
    if known:
        laid.feet()
    (profile,) = laid.laid_sweeps[0].heights(5.3 * 40e-6)
    at = x[0] + profile.s
    assert np.abs(profile.centers[:, 0] - at)[1:-1].max() < 1e-12
    # the mean over a bin is as much lower as the crest is bent: half its curvature times the variance within a bin
    wide = 5e-4**2 + (5.3 * 40e-6) ** 2 / 12.0
    mean = 1e-4 * 5e-4 / np.sqrt(wide) * np.exp(-0.5 * at**2 / wide)
    # by the means of their samples, half a step beside, they would be 2.4 um off on the flanks
    assert np.abs(profile.height - mean)[1:-1].max() < 0.25e-6
    assert np.abs(profile.t - at / 40e-6 - 500.0)[1:-1].max() < 1e-6


def test_means_over_one_plane_follow_from_the_feet_that_are_known(base):
    laid = LaidTrace(sweeps(), base)
    laid.feet()
    Counted.points = 0
    first = np.arange(0, 400, 8)
    for sweep in laid.laid_sweeps:
        centers = np.add.reduceat(sweep.trace.centers, first, axis=0) / 8
        points, normals, height = sweep.feet_of_means(centers, first, 400)
        assert Counted.points < 5  # only where a sweep changes from one triangle of the folded base to the other
        alone = Base(base.surface).foot(centers, TIP)
        assert np.allclose(points, alone.points, rtol=0, atol=1e-15)
        assert np.allclose(normals, alone.normals, rtol=0, atol=1e-12)
        assert np.allclose(height, alone.height, rtol=0, atol=1e-15)
        Counted.points = 0


def test_directions_between_what_is_known_are_those_of_the_base():
    turn = np.linspace(0.0, np.pi, 181)
    ring = 0.05 * np.column_stack([np.cos(turn), np.sin(turn)])
    corners = np.array([[*each, z] for z in (-0.05, 0.05) for each in ring])
    low = np.arange(180)
    faces = np.concatenate([np.stack([low, low + 1, low + 181], 1), np.stack([low + 1, low + 182, low + 181], 1)])
    half = Base(Surface(corners, faces))
    angle = np.linspace(0.6, 2.5, 4000)
    centers = 0.055 * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(4000)])
    laid = LaidTrace(Trace(np.arange(4000.0), centers, np.zeros(4000, dtype=int), TIP), half)
    for sweep in laid.laid_sweeps:
        sweep.heights(2e-4)
    asked = 0.5 * (centers[100:-100:7] + centers[101:-99:7])
    off = np.linalg.norm(laid.directions()(asked) - half.foot(asked, TIP).normals, axis=1)
    assert off.max() < 0.02  # a facet turns by 0.017


def test_further_sweeps_are_appended_and_some_are_taken_without_laying_what_is_known(base):
    laid = LaidTrace(sweeps(), base)
    laid.feet()
    Counted.points = 0
    both = laid.appended(sweeps(2, first=3))
    both.feet()
    assert Counted.points == 800 and len(both) == 2000
    part = both.of_sweeps({1, 4})
    wanted = both.select(np.isin(both.sweep, [1, 4]))
    assert np.array_equal(part.centers, wanted.centers) and [s.number for s in part.laid_sweeps] == [1, 4]
    assert same(part.feet(), Base(base.surface).foot(wanted.centers, TIP)) and Counted.points == 800
    keep = both.centers[:, 0] > 0.0
    assert same(both.within(keep).feet(), Base(base.surface).foot(both.centers[keep], TIP)) and Counted.points == 800


def test_a_laid_trace_is_a_trace_and_another_base_lays_it_anew(base):
    trace = sweeps()
    laid = LaidTrace.of(trace, base)
    assert isinstance(laid, Trace) and len(laid) == len(trace) and laid.tip_radius == TIP
    assert LaidTrace.of(laid, base) is laid
    other = Base(base.surface)
    assert LaidTrace.of(laid, other) is not laid and LaidTrace.of(laid, other).base is other
    empty = LaidTrace(trace.select(slice(0, 0)), base)
    assert len(empty.feet().points) == 0 and empty.laid_sweeps == ()
