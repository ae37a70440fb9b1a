"""The pose: a model that was given a little askew is put where the object stands, and features stay features."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from explore3d.scene.mesh_files import load_mesh
from hw.simulated.finger import SimulatedFinger
from mapping.base.base import Base
from mapping.base.pose import Pose, estimate_pose
from mapping.errors import TraceError
from mapping.surface import Surface
from mapping.trace import Trace
from planners.survey.survey import Survey

MESHES = Path(__file__).resolve().parents[3] / "assets" / "meshes"


def true_pose(base: Base, turn: float, shift: list[float]) -> Pose:
    """A turn (deg) about a slanting axis through the middle of the model, and a shift (m)."""
    axis = np.array([1.0, 0.5, -0.7])
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = np.radians(turn)
    rotation = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    middle = base.surface.bounds.mean(axis=0)
    return Pose(rotation, middle + np.array(shift) - rotation @ middle, middle, np.zeros((6, 6)))


def swept(base: Base, object: Surface, tip: float, every: int, rate: float = 500.0, **noise: float) -> Trace:
    """Every so many sweeps of a survey of the model, over the object."""
    finger = SimulatedFinger(object=object, tip_radius=tip, rate=rate, seed=3, **noise)  # type: ignore[arg-type]
    moves = list(Survey(base=base, tip_radius=tip, smallest=3e-4).sweeps())[every // 2 :: every]
    return Trace.concatenate([trace for move in moves if len(trace := finger.execute(move))])


def mesh(name: str) -> Surface:
    return load_mesh(MESHES / f"{name}.ply", "m")


def inner(trace: Trace, base: Base, border: float) -> Trace:
    low, high = base.surface.bounds
    keep = ((trace.centers[:, :2] > low[:2] + border) & (trace.centers[:, :2] < high[:2] - border)).all(axis=1)
    return trace.select(keep)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_plate_off_by_three_millimetres_and_two_degrees_is_found(sign: float) -> None:
    base = Base(mesh("tile"))
    true = true_pose(base, 2.0 * sign, [1.5e-3 * sign, -2e-3, 1.7e-3])
    object = Surface(true.onto(mesh("wire_on_tile").vertices), mesh("wire_on_tile").faces)
    trace = inner(swept(base, object, 5e-3, 2, white=5e-5, correlated=1e-5), base, 5e-3)
    pose = estimate_pose(trace, base)
    off = pose.onto(base.surface.vertices) - true.onto(base.surface.vertices)
    assert pose.observable == 3  # a plane slides in itself: two shifts and a spin stay as given
    assert np.abs(off @ true.rotation[:, 2]).max() < 2e-5
    heights = pose.moved(base).foot(trace.centers, 5e-3).height
    assert heights.max() == pytest.approx(0.65e-3, abs=2.5e-4)  # four standard deviations of the samples


def test_the_ends_of_a_plate_tell_how_far_it_slid() -> None:
    base = Base(mesh("tile"))
    true = true_pose(base, 0.0, [2e-3, 0.0, 1e-3])
    object = Surface(true.onto(mesh("tile").vertices), mesh("tile").faces)
    pose = estimate_pose(swept(base, object, 5e-3, 1, white=2e-5), base)
    assert pose.observable >= 4
    assert pose.shift[0] == pytest.approx(2e-3, abs=1e-4) and pose.shift[2] == pytest.approx(1e-3, abs=5e-6)


def test_a_mug_is_put_upright_and_its_ridge_keeps_its_height() -> None:
    base, detailed = Base(mesh("mug")), mesh("mug_with_details")
    true = true_pose(base, 2.0, [1.5e-3, -2e-3, 1.7e-3])
    object = Surface(true.onto(detailed.vertices), detailed.faces)
    trace = swept(base, object, 4e-3, 5, white=5e-5, correlated=1e-5)
    pose = estimate_pose(trace, base)
    known = Base(Surface(true.onto(base.surface.vertices), base.surface.faces))
    error = pose.moved(base).foot(trace.centers, 4e-3).height - known.foot(trace.centers, 4e-3).height
    assert np.abs(error).max() < 1e-5  # what is at stake: the heights of the features
    assert pose.observable in (4, 5)  # a tube turns in itself, and its ends may tell how high it stands


def test_an_edge_shows_all_six_motions() -> None:
    corners = np.array([[x, y, z] for x in (0.0, 0.06) for y in (0.0, 0.05) for z in (0.0, 0.04)])
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    base = Base(Surface(corners, [[q[i] for i in t] for q in quads for t in ((0, 1, 2), (0, 2, 3))]))
    true = true_pose(base, 1.5, [1e-3, 0.5e-3, -1e-3])
    trace = swept(base, Surface(true.onto(corners), base.surface.faces), 5e-3, 3, white=2e-5)
    pose = estimate_pose(trace, base)
    assert pose.observable == 6
    assert np.abs(pose.onto(corners) - true.onto(corners)).max() < 2e-5


@pytest.mark.slow
def test_the_covariance_holds_what_happens() -> None:
    base = Base(mesh("tile"))
    moves = list(Survey(base=base, tip_radius=5e-3, smallest=3e-4).sweeps())[1::4]
    shifts, sds = [], []
    for seed in range(14):
        finger = SimulatedFinger(object=base.surface, tip_radius=5e-3, rate=200.0, seed=seed, white=5e-5)
        pose = estimate_pose(Trace.concatenate([finger.execute(move) for move in moves]), base)
        shifts.append(pose.shift[2])
        sds.append(np.sqrt(pose.covariance[5, 5]))
    assert 0.5 < np.std(shifts) / np.mean(sds) < 1.6


def test_a_sphere_may_turn_as_it_likes() -> None:
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.03)
    base = Base(Surface(ball.vertices, ball.faces))
    turned = Surface(np.asarray(ball.vertices) @ true_pose(base, 30.0, [0, 0, 0]).rotation.T + [1e-3, 0, 0], ball.faces)
    pose = estimate_pose(swept(base, turned, 5e-3, 4, white=2e-5), base)
    assert pose.observable == 3
    middle = pose.onto(np.zeros((1, 3)))[0]
    assert middle == pytest.approx([1e-3, 0, 0], abs=3e-5)  # facets of 30 mm radius are 40 um deep


def test_poses_compose_and_survive_their_record() -> None:
    base = Base(mesh("tile"))
    one, two = true_pose(base, 1.0, [1e-3, 0, 0]), true_pose(base, -2.0, [0, 1e-3, 2e-3])
    points = np.random.default_rng(0).normal(size=(5, 3))
    assert np.allclose(two.after(one).onto(points), two.onto(one.onto(points)), atol=1e-15)
    assert np.allclose(one.back(one.onto(points)), points, atol=1e-15)
    twice = two.moved(one.moved(base))
    whole = Pose.of(twice)
    assert np.allclose(whole.onto(base.surface.vertices), twice.surface.vertices, atol=1e-15)
    assert one.turn == pytest.approx(np.radians(1.0)) and not one.within(3e-3, np.radians(0.5))


def test_too_few_samples_give_no_pose() -> None:
    with pytest.raises(TraceError, match="at least"):
        estimate_pose(Trace.from_profile([0.0, 1e-3], [1e-3, 1e-3], 1e-3), Base(mesh("tile")))
