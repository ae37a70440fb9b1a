"""Lines that are cut off at an edge of the body, beside a ball that is held against slabs by brute force."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from mapping import FloatArray
from mapping.geometry.templates import mouth_heights
from mapping.inference.curves import Chart, CurveModes, edges_along
from mapping.inference.families import BellRidgeShape, GrooveShape, RidgeShape, SmoothGrooveShape, TrapezoidShape
from mapping.inference.likelihood import Window

TIP = 3e-3
HALF_PLATE, THICK = 0.03, 5e-3
WIDTH, DEPTH = 2.8e-3, 0.4e-3
# A slab: a convex outline in plan (K, 2), anticlockwise, and where it begins and ends in height, m
Slab = tuple[FloatArray, float, float]


def cut(outline: FloatArray, normal: FloatArray, offset: float) -> FloatArray:
    """The part of an outline on which normal @ p >= offset."""
    off, kept = outline @ normal - offset, list[FloatArray]()
    for i in range(len(outline)):
        j = (i + 1) % len(outline)
        if off[i] >= 0.0:
            kept.append(outline[i])
        if off[i] * off[j] < 0.0:
            kept.append(outline[i] + off[i] / (off[i] - off[j]) * (outline[j] - outline[i]))
    return np.array(kept)


def slabs(way: FloatArray, steps: FloatArray, levels: FloatArray) -> list[Slab]:
    """A plate whose edge is x = 0, with a line of a section through the origin, out along `way` (2,).

    Args:
        steps: (J + 1,) distances beside the line between which the section has each of `levels` (J,), m.
    """
    plate = HALF_PLATE * np.array([[-1.0, -1.0], [0.0, -1.0], [0.0, 1.0], [-1.0, 1.0]])
    left = np.array([-way[1], way[0]])
    found = [(cut(plate, side * left, steps[-1]), -THICK, 0.0) for side in (-1.0, 1.0)]
    for side in (-1.0, 1.0):
        for low, high, level in zip(steps[:-1], steps[1:], levels, strict=True):
            found.append((cut(cut(plate, side * left, low), -side * left, -high), -THICK, level))
    return found


def distance(places: FloatArray, solid: Sequence[Slab]) -> FloatArray:
    """(N,) distances of places (N, 3) from the nearest of some slabs, m; 0 inside."""
    nearest = np.full(len(places), np.inf)
    for outline, low, high in solid:
        flat, inside = np.full(len(places), np.inf), np.ones(len(places), dtype=bool)
        for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True):
            leg, offset = b - a, places[:, :2] - a
            share = np.clip(offset @ leg / max(float(leg @ leg), 1e-30), 0.0, 1.0)
            flat = np.minimum(flat, np.linalg.norm(offset - share[:, None] * leg, axis=1))
            inside &= leg[0] * offset[:, 1] - leg[1] * offset[:, 0] >= 0.0
        upright = np.maximum(np.maximum(low - places[:, 2], places[:, 2] - high), 0.0)
        nearest = np.minimum(nearest, np.hypot(np.where(inside, 0.0, flat), upright))
    return nearest


def held(window: Window, solid: Sequence[Slab]) -> FloatArray:
    """(n,) heights of the ball over the bare plate's own trace, by halving, m."""
    low, high = np.full(len(window), -1.5e-3), np.full(len(window), 1.5e-3)
    for _ in range(30):
        middle = 0.5 * (low + high)
        inside = distance(window.feet + (TIP + middle)[:, None] * window.normals, solid) < TIP
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return 0.5 * (low + high)


def around_the_edge(beside: float) -> Window:
    """Places on the plate up to its edge, over it as the ball rolls, and on the wall, from -beside to beside."""
    y = np.linspace(-beside, beside, 23)
    turn = np.radians([0.0, 20.0, 50.0, 80.0])
    rolling = [(np.column_stack([0 * y, y, 0 * y]), [np.sin(each), 0.0, np.cos(each)]) for each in turn]
    wall = [(np.column_stack([0 * y, y, 0 * y - z]), [1.0, 0.0, 0.0]) for z in (0.0, 0.2e-3, 0.5e-3, 2e-3)]
    plate = [(np.column_stack([0 * y - x, y, 0 * y]), [0.0, 0.0, 1.0]) for x in (0.4e-3, 1.5e-3, 6e-3)]
    feet, normals = [np.concatenate(each) for each in zip(
        *((feet, np.tile(up, (len(y), 1))) for feet, up in (*rolling, *wall, *plate)), strict=True)]  # fmt: skip
    count, flat = len(feet), np.zeros(len(feet))
    ones = np.ones(count, dtype=np.int64)
    return Window(feet, normals, np.zeros((count, 3)), flat, ones, flat, flat, flat, np.array([0, count]), count)


def out_along(way: FloatArray) -> tuple[Chart, CurveModes]:
    """A straight chart of 20 mm to the edge."""
    s, tangent, up = np.array([0.0, 10e-3, 20e-3]), np.array([*way, 0.0]), np.array([0.0, 0.0, 1.0])
    points, zero = (s - s[-1])[:, None] * tangent, np.zeros(3)
    frame = [np.tile(each, (3, 1)) for each in (tangent, np.cross(up, tangent), up)]
    chart = Chart(s, points, *frame, zero, zero, False, (None, np.array([1.0, 0.0, 0.0])))
    return chart, CurveModes(1, 10e-3, 10e-3, False)


def shape(family: Any, window: Window, way: FloatArray, **rest: Any) -> Any:
    chart, modes = out_along(way)
    return family(window, chart, modes, TIP, **rest, priors=(), start=np.array([0.0, 0.0, 0.0]), step=np.zeros(3))


def outwards(degrees: float) -> FloatArray:
    """Direction of a line that meets the edge at an angle."""
    return np.array([np.sin(np.radians(degrees)), np.cos(np.radians(degrees))])


@pytest.mark.parametrize("degrees", [90.0, 50.0, 140.0])
def test_a_slot_that_opens_at_an_edge_is_felt_as_it_is(degrees: float) -> None:
    window, way = around_the_edge(3e-3), outwards(degrees)
    slot = shape(GrooveShape, window, way)
    object.__setattr__(slot, "start", np.array([0.0, 0.0, 0.5, -20e-3, 21e-3, np.log(WIDTH), np.log(DEPTH)]))
    felt = slot.templates(slot.start[None])[0]
    true = held(window, slabs(way, np.array([0.0, 0.5 * WIDTH]), np.array([-DEPTH])))
    assert true.min() < -0.3e-3
    assert np.abs(felt - true).max() < 1e-6


@pytest.mark.parametrize("degrees", [90.0, 60.0])
def test_a_bar_that_opens_at_an_edge_is_felt_as_it_is(degrees: float) -> None:
    window, way = around_the_edge(3e-3), outwards(degrees)
    bar = shape(TrapezoidShape, window, way, roof=False)
    theta = np.array([[0.0, 0.0, 0.5, -20e-3, 21e-3, DEPTH, np.log(1.2e-3), np.log(1e-9)]])
    true = held(window, slabs(way, np.array([0.0, 0.6e-3]), np.array([DEPTH])))
    assert true.max() > 0.38e-3
    assert np.abs(bar.templates(theta)[0] - true).max() < 1e-6


@pytest.mark.parametrize("degrees", [pytest.param(90.0, marks=pytest.mark.slow), 60.0])
@pytest.mark.parametrize("family", [SmoothGrooveShape, BellRidgeShape, RidgeShape])
def test_round_and_smooth_sections_are_cut_off_as_they_are(family: Any, degrees: float) -> None:
    window, way = around_the_edge(3e-3), outwards(degrees)
    line = shape(family, window, way)
    ends, steps = [-20e-3, 21e-3], np.linspace(0.0, 1.8e-3, 91)
    middle = 0.5 * (steps[1:] + steps[:-1])
    if family is RidgeShape:
        theta = np.array([[0.0, 0.0, 0.5, *ends, DEPTH, np.log(0.5e-3)]])
        levels = np.maximum(DEPTH - 0.5e-3 + np.sqrt(np.maximum(0.25e-6 - middle**2, 0.0)), 0.0)
    else:
        height, half, taper = DEPTH if family is BellRidgeShape else np.log(DEPTH), 0.8e-3, -0.4
        pair = [height, np.log(half)] if family is BellRidgeShape else [np.log(half), height]
        theta = np.array([[0.0, 0.0, *ends, *pair, taper]])
        square = middle**2 / (half**2 / (np.expm1(taper * np.log(2.0)) / taper))
        levels = DEPTH * np.maximum(1.0 + taper * square, 0.0) ** (-1.0 / taper)
        levels = levels if family is BellRidgeShape else -levels
    felt, true = line.templates(theta)[0], held(window, slabs(way, steps, levels))
    # stairs of 20 um are up to 5 um off on flanks this steep
    assert np.abs(true).max() > 0.25e-3
    assert np.abs(felt - true).max() < 8e-6


def test_a_line_that_ends_before_the_edge_is_not_felt_beyond_it() -> None:
    window, way = around_the_edge(3e-3), outwards(90.0)
    slot = shape(GrooveShape, window, way)
    theta = np.array([[0.0, 0.0, 0.5, -20e-3, 15e-3, np.log(WIDTH), np.log(DEPTH)]])
    object.__setattr__(slot, "start", theta[0])
    felt = slot.templates(theta)[0]
    assert (felt[window.feet[:, 0] > -4e-3] == 0.0).all() and (felt < 0.0).any()


def test_where_it_ends_beyond_the_edge_makes_no_difference() -> None:
    window, way = around_the_edge(3e-3), outwards(70.0)
    groove = shape(SmoothGrooveShape, window, way)
    theta = np.array([[0.0, 0.0, -20e-3, end, np.log(0.8e-3), np.log(DEPTH), -0.4] for end in (20.1e-3, 22e-3)])
    one, other = groove.templates(theta)
    assert (one == other).all()


def test_a_course_beside_its_chart_meets_an_edge_that_cuts_at_a_slant_elsewhere() -> None:
    way = outwards(50.0)
    chart, modes = out_along(way)
    aside, heading = 0.4e-3, 0.05
    first, last = edges_along(chart, modes, np.array([[aside, heading]]))[0]
    points, laterals, _, _ = chart.at(np.array([last]))
    met = points[0] + modes.lateral(np.array([[aside, heading]]), np.array([last]))[0, 0] * laterals[0]
    assert first == -np.inf
    assert met[0] == pytest.approx(0.0, abs=1e-12) and abs(last - 20e-3) > 0.3e-3


def test_a_mouth_on_an_edge_that_bends_is_felt_as_it_is() -> None:
    radius, half, across = 15e-3, 1.5e-3, np.linspace(0.0, 1.5e-3, 41)
    up = -0.4e-3 * np.cos(0.5 * np.pi * across / half) ** 2
    # the end of a round bar, z < 0, with a groove along it; its outline in plan, by close points
    arc = np.linspace(-8e-3, 8e-3, 16001)
    rim = radius - np.where(np.abs(arc) < half, 0.4e-3 * np.cos(0.5 * np.pi * arc / half) ** 2, 0.0)
    outline = rim[:, None] * np.column_stack([np.cos(arc / radius), np.sin(arc / radius)])
    turn, beside = (each.ravel() for each in np.meshgrid(np.radians([0.0, 30.0, 60.0]), np.linspace(-2e-3, 2e-3, 17)))
    out = np.column_stack([np.cos(beside / radius), np.sin(beside / radius)])
    low, high = np.full(len(turn), -1e-3), np.full(len(turn), 1e-3)
    for _ in range(30):
        reach = TIP + 0.5 * (low + high)
        in_plan = (radius + reach * np.cos(turn))[:, None] * out
        flat = np.linalg.norm(in_plan[:, None] - outline, axis=2).min(axis=1)
        inside = np.hypot(flat, reach * np.sin(turn)) < TIP
        low, high = np.where(inside, reach - TIP, low), np.where(inside, high, reach - TIP)
    # in the frame of the edge: out along the bar, beside, and out of its side
    points = np.column_stack([0.0 * turn, radius * out[:, 1], radius * (out[:, 0] - 1.0)])
    ways = np.column_stack([np.sin(turn), np.cos(turn) * out[:, 1], np.cos(turn) * out[:, 0]])
    felt, nothing = np.empty((1, len(turn))), np.zeros(1)
    wall = np.array([1.0, 0.0, 0.0])
    mouth_heights(points[:, None], ways, wall, 1.0 / radius, nothing, nothing, across[None], up[None], TIP, felt)
    assert low.min() < -0.15e-3
    assert np.abs(felt[0] - low).max() < 2e-6
