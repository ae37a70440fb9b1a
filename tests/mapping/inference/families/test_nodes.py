"""Nodes: on coarse facets a ball is where its centre is, not where its foot is."""

import numpy as np
import pytest

from mapping import FloatArray, Surface
from mapping.base import Base
from mapping.inference.curves import CurveModes, chart_along
from mapping.inference.families.nodes import line_nodes
from mapping.inference.likelihood import Window

RADIUS, TIP, FACETS = 13e-3, 3e-3, 45


def coarse_cylinder() -> Base:
    turn = 2.0 * np.pi * np.arange(FACETS) / FACETS
    ring = RADIUS * np.column_stack([0.0 * turn, np.sin(turn), np.cos(turn)])
    here, ahead, end = np.arange(FACETS), np.roll(np.arange(FACETS), -1), 0.03 * np.eye(3)[0]
    vertices = np.concatenate([ring - end, ring + end])
    faces = [np.column_stack([here, ahead, FACETS + here]), np.column_stack([ahead, FACETS + ahead, FACETS + here])]
    base = Base(Surface(vertices, np.concatenate(faces)))
    outward = (base.surface.face_normals * vertices[base.surface.faces].mean(axis=1)).sum() > 0.0
    return base if outward else Base(Surface(vertices, np.concatenate(faces)[:, ::-1]))


def at(along: FloatArray | float, turn: FloatArray, radius: float) -> FloatArray:
    return np.column_stack([along + 0.0 * turn, radius * np.sin(turn), radius * np.cos(turn)])


@pytest.mark.parametrize("middle", [0.0, 1.0, 2.5, 4.0])
def test_places_across_a_line_on_facets_are_those_on_the_round_body(middle: float) -> None:
    base, turn = coarse_cylinder(), np.radians(np.linspace(-7.0, 7.0, 57))
    axis = at(np.linspace(-5e-3, 5e-3, 9), np.full(9, np.radians(middle)), RADIUS)
    chart = chart_along(axis, axis * [0.0, 1.0, 1.0] / RADIUS, base, TIP, 0.5e-3, 1e-3, 2e-3)
    feet = base.foot(at(0.0, np.radians(middle) + turn, RADIUS + TIP), TIP)
    ones, place = np.ones(len(turn)), RADIUS * turn
    window = Window(feet.points, feet.normals, np.tile([0.0, 1.0, 0.0], (len(turn), 1)), feet.height,
                    ones.astype(np.int64), place, place, 0.0 * ones, np.array([0, len(turn)]), len(turn))  # fmt: skip
    lateral = line_nodes(window, chart, CurveModes(1, 0.0, 5e-3, False), TIP)[1][:, 0]
    by_foot = chart.coordinates(feet.points)[1]
    side = np.sign(lateral[-1])
    assert np.abs(side * lateral - place).max() < 50e-6
    assert np.abs(side * by_foot - place).max() > 80e-6
