"""What all crossings show alike is weighed once: it is no evidence for another detail from each of them."""

from __future__ import annotations

import numpy as np
import pytest

from mapping import Feature, FloatArray, Interval, Support, Surface, Trace
from mapping.base import Base
from mapping.geometry.templates import cap_height
from mapping.inference.configuration import Places
from mapping.inference.configuration.common_deviation import DEVIATION_SHARES
from mapping.inference.configuration.configuration import Configuration, as_twin, fitted, part_of
from mapping.inference.configuration.neighbourhood import neighbourhood
from mapping.inference.families import Surroundings
from mapping.instrument import Noise

TIP, HEIGHT, NOISE, SPACING = 10e-3, 0.6e-3, Noise(5e-6), 120e-6
CORNERS = 0.1 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
PLATE = Base(Surface(CORNERS, [[0, 1, 2], [0, 2, 3]]))
UP = np.array([0.0, 0.0, 1.0])


def wire_with(error: FloatArray) -> Configuration:
    """A wire whose crossings (runs of 101 places) are wrong by (runs, 101) heights, m, fitted as a wire."""
    runs, y = len(error), SPACING * np.arange(-50.0, 51.0)
    x = np.linspace(-10e-3, 10e-3, runs)
    felt = cap_height(np.abs(y), HEIGHT, 0.5 * HEIGHT, TIP) + error
    felt = felt + NOISE.white * np.random.default_rng(1).standard_normal(felt.shape)
    feet = np.column_stack([np.repeat(x, len(y)), np.tile(y, runs), np.zeros(felt.size)])
    sweep = np.repeat(np.arange(runs), len(y))
    trace = Trace(1e-3 * np.arange(float(felt.size)), feet + (TIP + felt.reshape(-1, 1)) * UP, sweep, TIP)
    places = Places(feet, np.tile(UP, (felt.size, 1)), felt.reshape(-1), np.ones(felt.size, dtype=np.int64), sweep,
                    SPACING)  # fmt: skip
    axis = np.array([[-12e-3, 0.0, 0.0], [0.0, 0.0, 0.0], [12e-3, 0.0, 0.0]])
    size = Interval.normal(HEIGHT, 5e-6)
    wire = Feature("ridge", axis, np.tile(UP, (3, 1)), size, size, size, Support(100.0, runs), True, 20e-6)
    place = neighbourhood([wire], [], places, Surroundings(trace, PLATE, NOISE), 0.01)
    assert place is not None
    found = fitted([part_of(wire, place, 1)], place)
    assert found is not None
    return found


def factor(found: Configuration) -> float:
    """Log Bayes factor of a section that deviates; the same parts without it are the rest of the log odds."""
    return found.deviation.log_factor


def wavy(amplitude: float, runs: int, signs: FloatArray) -> FloatArray:
    """(runs, 101) waves of 1.2 mm about the crest, of these signs."""
    y = SPACING * np.arange(-50.0, 51.0)
    return amplitude * signs[:, None] * np.cos(2.0 * np.pi * y / 1.2e-3) * np.exp(-0.5 * (y / 1e-3) ** 2)


def test_an_exact_section_pays_little_for_what_it_might_have_deviated() -> None:
    found = wire_with(np.zeros((12, 101)))
    # one of the equally probable sizes is none
    assert -np.log(len(DEVIATION_SHARES)) <= factor(found) < 0.0
    assert found.fits


def test_what_all_crossings_show_alike_is_told_from_what_each_shows() -> None:
    alike = wire_with(wavy(6e-6, 12, np.ones(12)))
    by_turns = wire_with(wavy(6e-6, 12, np.tile([1.0, -1.0], 6)))
    assert factor(alike) > 5.0 and factor(by_turns) < 0.0
    assert alike.deviation.explained > 10.0 * by_turns.deviation.explained


def test_more_crossings_are_no_more_evidence_for_a_second_wire(monkeypatch: pytest.MonkeyPatch) -> None:
    # waves of 1 % of the height, alike at all crossings: two wires nearly touching explain a part of them. Taken for
    # noise, 24 crossings had them gain 4.7 on what 6 crossings say, 2.4 for each doubling
    beyond, doublings = [], range(4)
    one = wire_with(wavy(-6e-6, 6, np.ones(6)))
    # between them the ball does not sink: what nearly touches is no second wire at all
    assert fitted([as_twin(one.parts[0], one.place, 0.2e-3)], one.place) is None
    # but wires that lie on the base are as wide as they are high, and two whatever the ball bridges
    lying, free = (as_twin(one.parts[0], one.place, 0.2e-3, lying=each) for each in (True, False))
    assert lying.shape.names == free.shape.names[:-1]
    assert (lying.shape.templates(lying.start[None]) == free.shape.templates(free.start[None])).all()
    assert fitted([lying], one.place) is not None
    monkeypatch.setattr("mapping.inference.configuration.configuration.SINKS_SDS", 0.0)
    for runs in (6 * 2**k for k in doublings):
        found = wire_with(wavy(-6e-6, runs, np.ones(runs)))
        two = fitted([as_twin(found.parts[0], found.place, 0.2e-3)], found.place)
        assert two is not None
        beyond.append(found.log_odds - two.log_odds)
    assert min(beyond) > 0.0
    assert np.polyfit(doublings, beyond, 1)[0] > -0.5
