"""Most of a log may lie on details: a noise that is stated says where the search for the quiet path begins."""

from __future__ import annotations

import numpy as np

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


def test_passes_to_and_fro_over_a_wire_are_not_taken_for_correlated_noise() -> None:
    scene = wires(line(0.06))
    finger = SimulatedFinger(object=scene.object, tip_radius=R, white=NOISE.white, correlated=NOISE.correlated, seed=1)
    rows = [(x, 0.035) for x in (-0.02, 0.0, 0.02)]
    rows += [(x, 0.0045) for x in np.repeat(np.linspace(-0.028, 0.028, 8), 24)]
    paths = [np.array([[x, side * half, 0.98 * R] for side in (-1, 1)]) for x, half in rows]
    trace = Trace.concatenate([finger.execute(Move(path, DOWN, speed=0.25, purpose="sweep")) for path in paths])
    found = detect(trace, Base(scene.base), stated=StatedNoise(NOISE))
    assert len({crossing.sweep for crossing in found.crossings}) > 0.9 * len(rows)
    assert found.noise.correlated < 0.25 * NOISE.white  # 0.4 mm where the crest passes for noise
