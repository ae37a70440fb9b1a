"""Features that are likeliest together, and what is not known of their neighbours."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from recorded_features import TIP, feature, line, plate, record, wire

from mapping.geometry.templates.shapes import cap_height, step_height
from mapping.inference.families import Surroundings
from mapping.inference.feature_posterior import refine, settle
from mapping.inference.joint.neighbours import laid_together
from mapping.inference.joint.refinement import refine_all
from mapping.instrument.noise import Noise

NOISE = Noise(5e-6)
HEIGHT, WIDTH, APART = 0.5e-3, 2.0e-3, 2.4e-3
RADIUS = 0.5 * HEIGHT + WIDTH**2 / (8.0 * HEIGHT)
TOPS = APART * np.array([[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [-1.0, -0.1, 0.0], [0.0, 1.0, 0.0], [1.0, 1.1, 0.0]])


def domes(feet):
    """Five caps, whose disturbances cover most of one another."""
    away = [np.linalg.norm(feet - top, axis=1) for top in TOPS]
    return np.max([cap_height(each, HEIGHT, RADIUS, TIP) for each in away], axis=0)


# Short: little of the base beside the domes is felt, and where that lies each of them has a say
ROWS = [line((-5.4e-3, y), (5.4e-3, y), 60e-6) for y in np.arange(-3.5e-3, 6e-3, 1e-3)]
# As tops are detected: the heights well, the widths not at all
GUESSES = [feature("bump", top[None], 0.97 * HEIGHT, 0.4e-3, 8, 0.3e-3) for top in TOPS]


def test_domes_that_touch_are_searched_for_together():
    trace = record(ROWS, domes, NOISE, 1)
    around = Surroundings(trace, plate(), NOISE)
    found = laid_together(GUESSES, around).features
    for one, top in zip(found, TOPS, strict=True):
        assert abs(one.height.median - HEIGHT) < 0.03 * HEIGHT and abs(one.width.median - WIDTH) < 0.15 * WIDTH
        np.testing.assert_allclose(one.axis[0], top, atol=0.06e-3)
    alone = settle(GUESSES[0], replace(around, others=GUESSES[1:]))
    assert abs(alone.height.median - HEIGHT) > 2.0 * abs(found[0].height.median - HEIGHT)


def test_what_is_not_known_of_neighbours_is_doubt_of_a_feature():
    trace = record(ROWS, domes, NOISE, 2)
    together = laid_together(GUESSES, Surroundings(trace, plate(), NOISE))
    doubt = together.doubt_beside(0)
    held = {"base": plate(), "noise": NOISE, "others": doubt.near, "confirm": None}
    sure = refine(GUESSES[0], trace, np.random.default_rng(0), **held)
    doubtful = refine(GUESSES[0], trace, np.random.default_rng(0), widened=doubt.widened, **held)
    own, with_theirs = (one.posterior.samples.std(axis=0) for one in (sure, doubtful))
    of_all = np.sqrt(np.diag(together._covariance)[:4])
    assert (own / of_all).min() < 0.9
    np.testing.assert_allclose(with_theirs, of_all, rtol=0.1)


@pytest.mark.slow
def test_domes_are_all_as_high_as_they_are():
    found = refine_all(GUESSES, record(ROWS, domes, NOISE, 3), 0, base=plate(), noise=NOISE, confirm=None)
    for one in found:
        assert one.height.low - 1e-6 < HEIGHT < one.height.high + 1e-6 and not any(
            "no ideal" in note for note in one.notes
        )


@pytest.mark.parametrize(("apart", "second"), [(4e-3, 0.2e-3), (3e-3, -0.15e-3)])
def test_two_near_steps_are_changes_of_one_level_and_the_next(apart, second):
    """A stair, and a terrace, whose second wall lies in the window of the first one."""

    def felt(feet):
        up = 1.0 if second > 0.0 else -1.0
        return step_height(feet[:, 0], 0.2e-3, TIP) + step_height(up * (feet[:, 0] - apart), abs(second), TIP)

    rows = [line((-12e-3, y), (12e-3, y), 60e-6) for y in np.arange(-6e-3, 6.5e-3, 1e-3)]
    guesses = [
        feature("step", np.array([[x, -5e-3, 0.0], [x, 5e-3, 0.0]]), height, 0.0, 10)
        for x, height in ((0.0, 0.2e-3), (apart, second))
    ]
    found = refine_all(guesses, record(rows, felt, NOISE, 1), 0, base=plate(), noise=NOISE, confirm=None)
    for one, height, x in zip(found, (0.2e-3, second), (0.0, apart), strict=True):
        assert one.details.misfit is None
        assert abs(one.height.median - height) < 2e-6
        np.testing.assert_allclose(one.axis[:, 0], x, atol=0.05e-3)
        assert np.sign(one.height.median) == np.sign(height)


@pytest.mark.parametrize("side", [-1.0, pytest.param(1.0, marks=pytest.mark.slow)])
def test_a_wire_stands_on_the_level_of_a_step_beside_it(side):
    wall = feature("step", np.array([[0.0, -9e-3, 0.0], [0.0, 9e-3, 0.0]]), 0.3e-3, 0.0, 10)
    wall = replace(wall, details=replace(wall.details, high_side=-1.0))  # x > 0
    ends = np.array([[4e-3 * side, -8e-3, 0.0], [4e-3 * side, 8e-3, 0.0]])
    top = wire(ends + np.array([0.0, 0.0, max(side, 0.0) * 0.3e-3]), 0.4e-3)

    def felt(feet):
        return np.maximum(step_height(feet[:, 0], 0.3e-3, TIP), top(feet))

    rows = [line((-15e-3, y), (15e-3, y), 120e-6) for y in np.arange(-10e-3, 10.5e-3, 2e-3)]
    guess = feature("ridge", ends * [1.0, 0.9, 1.0], 0.35e-3, 0.4e-3, 8)
    trace = record(rows, felt, NOISE, 1)
    found = refine(guess, trace, np.random.default_rng(0), base=plate(), noise=NOISE, others=[wall], confirm=None)
    assert found.details.misfit is None
    assert abs(found.height.median - 0.4e-3) < 4e-6


def test_nothing_is_felt_beside_a_step_where_runs_see_its_high_level_alone():
    """All that it adds to them is a height of the base; a pit that covers most of a run would stand for it, too."""
    wall = feature("step", np.array([[0.0, -9e-3, 0.0], [0.0, 9e-3, 0.0]]), 2e-3, 0.0, 10)
    wall = replace(wall, details=replace(wall.details, high_side=-1.0))  # x > 0
    base = replace(plate(), parameters={"levels": [0.0, 2e-3]})
    trace = record([line((-15e-3, 0.0), (18e-3, 0.0), 1e-3)], lambda feet: step_height(feet[:, 0], 2e-3, TIP), NOISE, 1)
    guess = feature("pit", np.array([[9e-3, 0.0, 0.0]]), -0.05e-3, 1e-3, 1)
    found = refine(guess, trace, np.random.default_rng(0), base=base, noise=NOISE, others=[wall], confirm=None)
    assert found.evidence.log_odds < 0.0
