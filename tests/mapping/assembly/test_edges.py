"""Edges that the base does not have are found; edges that it has are not."""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np
import pytest

from explore3d.bench.detection.classify import classified, noisy, touched
from explore3d.bench.scenes.kinds import BODIES_BY_KIND
from hw.errors import StoppedError
from hw.simulated.finger import SimulatedFinger
from hw.simulated.noise_source import NoiseSource
from mapping.base.base import Base
from mapping.surface import Surface
from mapping.trace import Trace
from planners.paths.strokes import Strokes

DATA = Path(__file__).parents[4] / "shared" / "data"
TIP = 0.01


@pytest.mark.parametrize("kind", ["convex edge", "concave corner"])
@pytest.mark.parametrize("white", [pytest.param(0.0, marks=pytest.mark.slow), 0.2e-3])
def test_a_fold_is_an_edge_where_the_faces_meet(kind, white):
    (edge,) = classified(noisy(touched(kind, "two ways", 0), NoiseSource(white), 1), Base(BODIES_BY_KIND[kind]().base))
    assert edge.kind == kind
    assert np.abs(edge.axis[:, 0]).max() < 0.3e-3
    assert edge.extra["angle"] == pytest.approx(np.radians(20.0), abs=np.radians(0.2))
    assert edge.length.censored


def over(surface: Surface, lines, white: float, seed: int) -> Trace:
    """Sweeps of the simulated finger over a body, each through a point along a direction, 30 mm to either side.

    A wall stops a sweep that no planner has routed, and at least half of those asked for must be felt.
    """
    strokes = Strokes(Base(surface), TIP)
    finger = SimulatedFinger(object=surface, tip_radius=TIP, rate=2500.0, white=white, seed=seed)
    felt = []
    for point, way in lines:
        with contextlib.suppress(StoppedError):
            felt.append(finger.execute(strokes.line(np.array(point), np.array(way), 0.03, 0.03)))
    assert sum(len(trace) > 0 for trace in felt) >= len(lines) / 2
    return Trace.concatenate([trace for trace in felt if len(trace)])


def cube(side: float) -> Surface:
    corners = side * (np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)]) - 0.5)
    quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    return Surface(corners, [[q[0], q[i], q[i + 1]] for q in quads for i in (1, 2)])


@pytest.mark.parametrize("white", [pytest.param(0.0, marks=pytest.mark.slow), 0.2e-3])
def test_edges_of_a_cube_are_no_features_of_it(white):
    body = cube(0.05)
    lines = [((x, 0.0, 0.025), (0.1 * k, 1.0, 0.0)) for k, x in enumerate(np.linspace(-0.02, 0.02, 6))]
    assert classified(over(body, lines, white, 0), Base(body)) == ()


@pytest.mark.slow
@pytest.mark.skipif(not (DATA / "fandisk.off").exists(), reason=f"{DATA} has no fandisk.off")
@pytest.mark.parametrize("white", [pytest.param(0.0, marks=pytest.mark.slow), 0.2e-3])
def test_edges_of_the_fandisk_are_no_features_of_it(white):
    from explore3d.scene.mesh_files import load_mesh

    raw = load_mesh(DATA / "fandisk.off", "m")
    scale = 0.15 / raw.size
    body = Surface(scale * (raw.vertices - raw.vertices.mean(axis=0)), raw.faces)
    rng = np.random.default_rng(0)
    middles = body.vertices[body.faces].mean(axis=1)
    chosen = rng.choice(len(middles), 12, replace=False)
    lines = [(middles[k], np.cross(body.face_normals[k], rng.standard_normal(3))) for k in chosen]
    assert classified(over(body, lines, white, 3), Base(body)) == ()
