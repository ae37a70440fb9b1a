"""Ridge following: lines that a single sweep does not show."""

from __future__ import annotations

import numpy as np

from explore3d.bench.exploration.exploring import APPARATUS
from explore3d.bench.scenes.exploring import BENCH_TIP_RADIUS as TIP_RADIUS, groove
from hw.simulated.finger import SimulatedFinger
from mapping.base.base import Base
from mapping.detection.crossing import Crossing
from mapping.instrument.noise import Noise
from planners.drive import drive
from planners.follow.ridge_follower import RidgeFollower
from planners.follow.sense import Sense
from planners.paths.strokes import Strokes

NOISE = Noise(APPARATUS["white"], APPARATUS["correlated"], APPARATUS["correlation_length"])


def test_a_groove_a_quarter_of_the_noise_deep_is_followed_to_its_ends_by_many_passes() -> None:
    scene = groove(np.random.default_rng(21))
    finger = SimulatedFinger(object=scene.object, tip_radius=TIP_RADIUS, seed=21, **APPARATUS)
    base, axis, up = Base(scene.base), scene.truth[0].axis, np.array([0.0, 0.0, 1.0])
    along = (axis[-1] - axis[0]) / np.linalg.norm(axis[-1] - axis[0])
    across = np.cross(up, along)
    start, way = axis[30] + 0.3e-3 * across, along + 0.03 * across
    faint = Crossing(0, 0.0, start, up, across, "concave", -0.043e-3, 4e-6, 3e-4, 1.05e-3, -70.0, 8.0, True, 0, 0)
    strokes, sense = Strokes(base, TIP_RADIUS), Sense(base, NOISE)
    follower = RidgeFollower(strokes, sense, NOISE, 0.012e-3, passes=17)
    _, outcome = drive(follower.follow(faint, [way, -way]), finger.execute)
    track = outcome.value
    assert [end.reason for end in track.ends] == ["end", "end"]
    errors = [min(np.linalg.norm(axis[[0, -1]] - end.point, axis=1)) for end in track.ends]
    assert max(errors) < 0.5e-3
    beside = (track.points - axis[0]) @ across
    assert np.sqrt(np.mean(beside**2)) < 0.15e-3
