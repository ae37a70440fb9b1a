"""The play of a machine's axes is told from the flanks of all crossings; where there is none, none is."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from mapping import FloatArray, Surface, Trace
from mapping.base import Base, LaidTrace
from mapping.detection import Detections, detect
from mapping.detection.path import Backlash, Lag, backlash, with_doubt, without_backlash
from mapping.detection.path.backlash_kernels import hang_behind, heights_of_caps, lowered_by

TIP, STEP, NOISE, SWEEPS = 5e-3, 50e-6, 20e-6, 12
HEIGHTS = np.array([0.12e-3, 0.2e-3, 0.16e-3])


def plate() -> Base:
    corners = 0.2 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    return Base(Surface(corners, np.array([[0, 1, 2], [0, 2, 3]])))


def played(path: FloatArray, play: float) -> FloatArray:
    """Where a stage stands that follows a path (N, 3) by the axes only as they are pulled: their ends of play."""
    out = path.copy()
    for before, now in itertools.pairwise(out):
        now[:] = np.minimum(np.maximum(before, now - 0.5 * play), now + 0.5 * play)
    return out


def swept(play: float, seed: int, steeper: float = 0.0, back: bool = False) -> Trace:
    """Sweeps across three wires; `steeper`: share of the height by which one side of each is steeper."""
    rng = np.random.default_rng((61, seed))
    x = np.arange(-45e-3, 45e-3, STEP)
    rows = []
    for k in range(SWEEPS):
        z = np.full(len(x), TIP)
        for height, place in zip(HEIGHTS, (-25e-3, 2e-3, 28e-3), strict=True):
            u = (x - place - rng.uniform(-1.0, 1.0) * STEP) / np.sqrt(2.0 * TIP * height)
            z += height * np.maximum(1.0 - u**2, 0.0) * (1.0 + steeper * np.clip(u, -1.0, 1.0))
        path = np.column_stack([x, np.full(len(x), 2e-3 * k), z])
        path = path[::-1] if back and k % 2 else path
        rows.append(played(path, play) + NOISE * rng.standard_normal((len(x), 1)) * [0.0, 0.0, 1.0])
    centers = np.concatenate(rows)
    return Trace(1e-3 * np.arange(len(centers)), centers, np.repeat(np.arange(SWEEPS), len(x)), TIP)


def asked(trace: Trace) -> tuple[LaidTrace, Detections, Backlash | None]:
    laid = LaidTrace.of(trace, plate())
    found = detect(laid, laid.base)
    return laid, found, backlash(laid, found)


@pytest.mark.slow
@pytest.mark.parametrize("back", [False, pytest.param(True, marks=pytest.mark.slow)])
@pytest.mark.parametrize("play", [pytest.param(20e-6, marks=pytest.mark.slow), 40e-6])
def test_a_play_is_told_and_heights_without_it_are_right(play: float, back: bool) -> None:
    trace = swept(play, seed=1, back=back)
    laid, found, told = asked(trace)
    off = [_height_error(found)]
    for _ in range(2):
        # at once, although the crests that were found lie late and low
        assert told is not None and told.one_way is not back
        assert abs(told.play - play) < 3.0 * told.sd and told.sd < 0.2 * play
        laid, found, _ = asked(without_backlash(trace, told))
        off.append(_height_error(found))
        before, told = told, backlash(laid, found, told)
    assert told is not None and abs(told.play - before.play) < told.sd
    assert off[-1] < 0.5 * off[0] and off[-1] < 0.3 * play
    said = with_doubt(found, told)
    assert said.remarks[-1] == told.sentence()
    assert min(c.position_sd for c in said.crossings) > 0.5 * told.play


def _height_error(found: Detections) -> float:
    """How far the heights of crossings are off that of the next wire, m."""
    heights = np.array([c.height for c in found.crossings])
    return float(np.abs(np.subtract.outer(heights, HEIGHTS)).min(axis=1).mean())


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 3, 4))])
def test_where_the_axes_have_no_play_none_is_told(seed: int) -> None:
    assert asked(swept(0.0, seed=10 + seed, back=bool(seed % 2)))[2] is None


def ring() -> Base:
    """A round column of facets of a degree, 90 mm across."""
    turn = np.radians(np.arange(360.0))
    corners = np.array([[0.045 * np.cos(a), 0.045 * np.sin(a), z] for z in (-0.05, 0.05) for a in turn])
    low, ahead = np.arange(360), np.roll(np.arange(360), -1)
    sides = [np.stack([low, ahead, low + 360], 1), np.stack([ahead, ahead + 360, low + 360], 1)]
    return Base(Surface(corners, np.concatenate(sides)))


@pytest.mark.slow
@pytest.mark.parametrize("play", [0.0, 20e-6])
def test_where_a_path_round_a_body_turns_an_axis_its_play_is_told_without_a_crest(play: float) -> None:
    rng, base = np.random.default_rng(7), ring()
    turn = np.arange(0.3, 5.0, STEP / 0.05)
    normals = np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn])
    rows = [
        played(0.05 * normals + [0.0, 0.0, 2e-3 * k], play) + NOISE * rng.standard_normal((len(turn), 1)) * normals
        for k in range(SWEEPS)
    ]
    trace = Trace(
        1e-3 * np.arange(SWEEPS * len(turn)), np.concatenate(rows), np.repeat(np.arange(SWEEPS), len(turn)), TIP
    )
    laid = LaidTrace.of(trace, base)
    told = backlash(laid, detect(laid, base))
    if not play:
        assert told is None
        return
    assert told is not None and told.told and abs(told.play - play) < 3.0 * told.sd < 0.5 * play
    off = (without_backlash(trace, told).centers - trace.centers) + np.concatenate(
        [played(0.05 * normals, play) - 0.05 * normals] * SWEEPS
    )
    left = np.einsum("ij,ij->i", off, np.tile(normals, (SWEEPS, 1)))
    assert left.std() < 0.15 * play


@pytest.mark.parametrize("seed", range(3))
def test_crests_that_are_steeper_on_one_side_are_no_play(seed: int) -> None:
    """One way they leave it in doubt; none is more probable, on trial too."""
    trace = swept(0.0, seed=20 + seed, steeper=0.3)
    laid, found, play = asked(trace)
    for _ in range(4):
        if play is None:
            break
        assert not play.told and play.probability < 0.5
        laid, found, _ = asked(without_backlash(trace, play))
        play = backlash(laid, found, play)


def test_a_play_in_doubt_is_left_in_the_heights_as_far_as_it_is_probable() -> None:
    lag = Lag(np.array([0.0, 1.0]), np.zeros((2, 3)))
    told, even = Backlash(20e-6, 4e-6, 20.0, False, lag), Backlash(20e-6, 4e-6, 0.0, False, lag)
    assert told.told and not even.told and even.probability == pytest.approx(0.5)
    # the doubt of one that was taken off, and all of one that may be there: on each half of the draws, or not at all
    assert told.height_sd == pytest.approx(0.75 * 4e-6)
    assert even.height_sd == pytest.approx(0.75 * np.sqrt(0.5 * (20e-6**2 + 4e-6**2)))
    assert even.aside(0.1e-3, 1e-3) > told.aside(0.1e-3, 1e-3)
    assert "may hang behind" in even.sentence() and "50 %" in even.sentence()
    assert even.record()["taken_off"] is False and told.record()["taken_off"] is True


@pytest.mark.parametrize("seed", range(3))
def test_few_crossings_leave_a_play_in_doubt_that_is_told_once_it_is_taken_off(seed: int) -> None:
    """Wires of three sweeps: on trial the play is more probable than before."""
    whole = swept(20e-6, seed=30 + seed, back=True)
    trace = whole.select(whole.sweep < 3)
    _, _, first = asked(trace)
    assert first is not None
    on_trial, seen, _ = asked(without_backlash(trace, first))
    again = backlash(on_trial, seen, first)
    assert again is not None and again.gain > first.gain


def test_what_a_play_takes_off_is_what_the_axes_of_the_path_over_the_caps_hang_behind():
    rng = np.random.default_rng(2)
    s, crests = np.linspace(0.0, 0.02, 300), np.array([[4e-4, 0.006, 0.002], [-2e-4, 0.013, 0.004]])
    normals = rng.standard_normal((300, 3))
    level = np.cumsum(1e-5 * rng.standard_normal((300, 3)), axis=0)
    caps = heights_of_caps(s, crests)
    height, place, half = crests.T[:, :, None]
    np.testing.assert_array_equal(caps, (height * np.maximum(1.0 - ((s - place) / half) ** 2, 0.0)).sum(axis=0))
    behind = hang_behind(level + caps[:, None] * normals, 3e-5)
    np.testing.assert_allclose(lowered_by(level, normals, caps, 3e-5), (behind * normals).sum(axis=1), atol=1e-18)
    assert np.abs(behind).max() == 3e-5
