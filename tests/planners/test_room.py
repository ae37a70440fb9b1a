"""Room: what a grid of distances tells of a place is true, and spares asking the body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from mapping.base.base import Base
from mapping.surface import Surface
from planners.paths.carrier import Carrier
from planners.paths.detour import Detour
from planners.paths.room import room_about

TIP = 3e-3
RNG = np.random.default_rng(3)


def body(solid: trimesh.Trimesh) -> Base:
    return Base(Surface(solid.vertices, solid.faces))


RING = body(trimesh.creation.torus(0.02, 0.008))
BOX = body(trimesh.creation.box([0.04, 0.03, 0.01]))
SHEET = Base(Surface([[-0.02, -0.02, 0], [0.02, -0.02, 0], [0.02, 0.02, 0], [-0.02, 0.02, 0]], [[0, 1, 2], [0, 2, 3]]))


@pytest.mark.parametrize("base", [RING, BOX], ids=["ring", "box"])
def test_no_place_is_nearer_or_farther_than_the_bounds_say(base: Base) -> None:
    room, places = room_about(base), RNG.uniform(-0.05, 0.05, (4000, 3))
    assert room is not None
    distance = base.foot(places, 0.0).height
    least, most = room.bounds(places)
    assert (least <= distance).all() and (distance <= most).all()
    # most places need not be asked whether a stem of half the ball's thickness has room there
    assert ((least >= 0.5 * TIP) | (most < 0.5 * TIP)).mean() > 0.8


def test_an_open_sheet_has_no_bounds() -> None:
    assert room_about(SHEET) is None
    assert room_about(replace(BOX, offset=1e-4)) is None
    assert room_about(BOX) is room_about(BOX)


@pytest.mark.parametrize("base", [RING, BOX], ids=["ring", "box"])
@pytest.mark.parametrize("backing", [0.0, 0.5 * TIP])
def test_what_is_free_is_what_the_body_itself_would_say(base: Base, backing: float) -> None:
    stem = replace(Carrier.of(base, TIP), backing=backing)
    asking = replace(stem)
    object.__setattr__(asking, "room", None)
    places, ways = RNG.uniform(-0.035, 0.035, (3000, 3)), RNG.normal(size=(3000, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    free = stem.is_free(places, ways)
    assert 0.1 < free.mean() < 0.9
    np.testing.assert_array_equal(free, asking.is_free(places, ways))
    for room in (None, 0.2 * TIP):
        np.testing.assert_array_equal(stem.ball_is_free(places, room), asking.ball_is_free(places, room))


def test_ways_in_the_open_stay_in_the_open() -> None:
    detour = Detour(Carrier.of(RING, TIP), np.full(3, -0.1), np.full(3, 0.1))
    nodes, graph = detour._graph
    pairs = np.column_stack(graph.nonzero())
    middles = 0.5 * (nodes[pairs[:, 0]] + nodes[pairs[:, 1]])
    assert len(pairs) > 1000 and detour._open(nodes).all() and detour._open(middles).all()
