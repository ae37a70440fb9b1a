"""Features that are likeliest together, and what is not known of their neighbours."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from recorded_features import TIP, feature, line, plate, record

from mapping.geometry.templates.shapes import cap_height
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


def test_domes_are_all_as_high_as_they_are():
    found = refine_all(GUESSES, record(ROWS, domes, NOISE, 3), 0, base=plate(), noise=NOISE, confirm=None)
    for one in found:
        assert one.height.low - 1e-6 < HEIGHT < one.height.high + 1e-6 and not any(
            "no ideal" in note for note in one.notes
        )
