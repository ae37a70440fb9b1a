"""Discovering: an unknown body in a box is felt, recognised, and bounded by what was felt."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from explore3d.scene.mesh_files import load_mesh
from hw.simulated.finger import SimulatedFinger
from mapping.base.base import Base
from mapping.surface import Surface
from planners.drive import drive
from planners.errors import PlannerError
from planners.explore.discover import Discover
from planners.explore.warm_up import get_ready

R = 5e-3
MESHES = Path(__file__).resolve().parents[3] / "assets" / "meshes"


def found(body: Surface, low: list[float], high: list[float], sides: tuple[str, ...] = ("+z",)) -> Base | None:
    finger = SimulatedFinger(object=body, tip_radius=R, rate=600.0, white=5e-5, correlated=1e-5, seed=1, margin=0.2)
    discover = Discover(low=np.array(low), high=np.array(high), tip_radius=R, smallest=3e-4, sides=sides)
    _, outcome = drive(discover.plan(), finger.execute)
    base: Base | None = outcome.value
    return base


def tube(radius: float, length: float) -> Surface:
    """A cylinder along x."""
    angle, x = np.linspace(0, 2 * np.pi, 513)[:-1], np.linspace(-0.5 * length, 0.5 * length, 9)
    ring = radius * np.column_stack([0 * angle, np.sin(angle), np.cos(angle)])
    vertices = (ring[None] + np.column_stack([x, 0 * x, 0 * x])[:, None]).reshape(-1, 3)
    i, k = (g.ravel() for g in np.meshgrid(np.arange(8), np.arange(512), indexing="ij"))
    a, b = i * 512 + k, i * 512 + (k + 1) % 512
    return Surface(vertices, np.concatenate([np.column_stack([a, a + 512, b]), np.column_stack([b, a + 512, b + 512])]))


def test_a_plate_with_a_wire_on_it_is_a_plane_in_the_box() -> None:
    base = found(load_mesh(MESHES / "wire_on_tile.ply", "m"), [-0.025, -0.015, -0.008], [0.025, 0.015, 0.008])
    assert base is not None and base.kind == "plane"
    assert np.abs(base.surface.vertices[:, 2]).max() < 1e-5
    assert np.allclose(base.surface.bounds[:, :2], [[-0.025, -0.015], [0.025, 0.015]], atol=2e-3)


@pytest.mark.slow
def test_a_plate_smaller_than_the_box_ends_where_it_ends() -> None:
    base = found(load_mesh(MESHES / "tile.ply", "m"), [-0.04, -0.028, -0.008], [0.04, 0.028, 0.008])
    assert base is not None and base.kind == "plane"
    assert np.abs(base.surface.vertices[:, 2]).max() < 2e-5
    ends = base.surface.bounds[:, 0]
    assert np.allclose(ends, [-0.03, 0.03], atol=1.5 * R)


@pytest.mark.slow
def test_the_top_of_a_cylinder_is_a_cylinder() -> None:
    base = found(tube(0.03, 0.2), [-0.03, -0.018, 0.0], [0.03, 0.018, 0.035])
    assert base is not None and base.kind == "cylinder"
    assert base.parameters["radius"] == pytest.approx(0.03, abs=5e-5)
    assert abs(base.parameters["axis"][0]) == pytest.approx(1.0, abs=1e-5)


@pytest.mark.slow
def test_the_top_of_a_sphere_is_a_sphere() -> None:
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=6, radius=0.03)
    base = found(Surface(ball.vertices, ball.faces), [-0.018, -0.018, 0.0], [0.018, 0.018, 0.035])
    assert base is not None and base.kind == "sphere"
    assert base.parameters["radius"] == pytest.approx(0.03, abs=5e-5)
    assert np.allclose(base.parameters["centre"], 0.0, atol=5e-5)


@pytest.mark.slow
def test_a_standing_mug_is_found_from_four_sides() -> None:
    sides = ("+x", "-x", "+y", "-y")
    base = found(load_mesh(MESHES / "mug_with_details.ply", "m"), [-0.046, -0.046, 0.01], [0.046, 0.046, 0.09], sides)
    assert base is not None and base.kind == "cylinder"
    assert base.parameters["radius"] == pytest.approx(0.04, abs=5e-5)
    assert base.surface.face_areas.sum() == pytest.approx(2 * np.pi * 0.04 * 0.08, rel=0.05)


def test_an_empty_box_holds_nothing() -> None:
    assert found(load_mesh(MESHES / "tile.ply", "m"), [-0.02, -0.01, 0.01], [0.02, 0.01, 0.02]) is None


def test_impossible_boxes_and_sides_are_refused() -> None:
    with pytest.raises(PlannerError, match="sides"):
        Discover(low=np.zeros(3), high=np.ones(3), tip_radius=R, smallest=1e-4, sides=("up",))
    with pytest.raises(PlannerError, match="below"):
        Discover(low=np.ones(3), high=np.zeros(3), tip_radius=R, smallest=1e-4)


@pytest.mark.slow
def test_a_block_on_a_table_is_a_polyhedron_without_its_underside() -> None:
    import trimesh

    block = trimesh.creation.box((0.06, 0.05, 0.04))
    sides = ("+x", "-x", "+y", "-y", "+z")
    base = found(Surface(block.vertices, block.faces), [-0.034, -0.029, -0.012], [0.034, 0.029, 0.024], sides)
    assert base is not None and base.kind == "polyhedron" and base.known
    low, high = base.surface.bounds
    assert np.allclose([*low[:2], *high], [-0.03, -0.025, 0.03, 0.025, 0.02], atol=2e-5)
    assert (base.surface.face_normals[:, 2] > -0.5).all(), "the underside was not asked for"


def test_what_exploring_loads_is_loaded_before_an_unknown_body_is_touched() -> None:
    get_ready.cache_clear()
    low, high = np.array([-0.02, -0.02, -0.01]), np.array([0.02, 0.02, 0.01])
    next(Discover(low=low, high=high, tip_radius=R, smallest=3e-4).plan())
    assert get_ready.cache_info().currsize == 1
