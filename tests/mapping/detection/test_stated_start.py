"""Most of a log may lie on details: where the search for its quiet path begins is stated, or was measured."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from explore3d.bench.scenes.exploring import line, wires
from hw.move import Move
from hw.simulated.finger import SimulatedFinger
from mapping.base.base import Base
from mapping.detection.detect import detect
from mapping.instrument.noise import Noise
from mapping.instrument.stated import StatedNoise
from mapping.trace import Trace

R = 0.01
DOWN = np.array([0.0, 0.0, -1.0])
NOISE = Noise(2e-4, 2e-5, 1e-3)


@pytest.mark.parametrize(
    "told",
    [{"stated": StatedNoise(NOISE)}, {"begin": NOISE}, {"begin": Noise(NOISE.white)}],
    ids=["stated", "measured", "measured white"],
)
def test_passes_to_and_fro_over_a_wire_are_not_taken_for_correlated_noise(told: dict[str, Any], passes: Trace) -> None:
    found = detect(passes, Base(wires(line(0.06)).base), **told)
    assert len({crossing.sweep for crossing in found.crossings}) > 0.9 * len(np.unique(passes.sweep))
    assert found.noise.correlated < 0.25 * NOISE.white  # 0.4 mm where the crest passes for noise


@pytest.fixture(scope="module")
def passes() -> Trace:
    """Of 195 sweeps all but three cross the wire."""
    scene = wires(line(0.06))
    finger = SimulatedFinger(object=scene.object, tip_radius=R, white=NOISE.white, correlated=NOISE.correlated, seed=1)
    rows = [(x, 0.035) for x in (-0.02, 0.0, 0.02)]
    rows += [(x, 0.0045) for x in np.repeat(np.linspace(-0.028, 0.028, 8), 24)]
    paths = [np.array([[x, side * half, 0.98 * R] for side in (-1, 1)]) for x, half in rows]
    return Trace.concatenate([finger.execute(Move(path, DOWN, speed=0.25, purpose="sweep")) for path in paths])
