"""Bases of bodies of no simple family, and of hollow ones."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.arrays import FloatArray
from mapping.base.base import Base
from mapping.base.fit import fit_base
from mapping.base.quadrics import Cloud, sheet, sheet_moved
from mapping.trace import Trace

TIP, NOISE = 0.01, 2e-5
TURN = np.linspace(0.0, 2.0 * np.pi, 500)


def swept(lines: list[FloatArray], normals: list[FloatArray] | None = None) -> Trace:
    """A trace of some lines of ball centres, with noise."""
    sweep = np.concatenate([np.full(len(line), number) for number, line in enumerate(lines)])
    points = np.concatenate(lines)
    points = points + NOISE * np.random.default_rng(0).standard_normal(points.shape)
    felt = None if normals is None else np.concatenate(normals)
    return Trace(np.arange(len(points)) * 1e-3, points, sweep, TIP, felt)


def egg(count: int = 15, lift: float = 0.0) -> list[FloatArray]:
    """Rings of ball centres about a body whose radius waves with the direction, with a crest along half a meridian."""
    lines = []
    for polar in np.linspace(0.05, np.pi - 0.05, count):
        x, y, z = np.sin(polar) * np.cos(TURN), np.sin(polar) * np.sin(TURN), np.cos(polar) + 0.0 * TURN
        radius = 0.05 * (1.0 + 0.15 * z + 0.1 * (x**2 - y**2) + 0.1 * x * y * z)
        beside = radius * np.sin(polar) * np.minimum(TURN, 2.0 * np.pi - TURN)
        radius = radius + np.maximum(lift - beside**2 / (2.0 * 1.03 * TIP), 0.0)
        lines.append(radius[:, None] * np.column_stack([x, y, z]))
    return lines


def vase() -> list[FloatArray]:
    """Rings of ball centres about a vase with three lobes."""
    levels = np.linspace(-0.05, 0.05, 21)
    radii = [0.04 + 0.004 * np.sin(level / 0.02) + 0.002 * np.cos(3.0 * TURN) for level in levels]
    return [
        np.column_stack([r * np.cos(TURN), r * np.sin(TURN), 0.0 * TURN + level])
        for r, level in zip(radii, levels, strict=True)
    ]


def around_block() -> list[FloatArray]:
    """Ball centres on lines round a block of 80 x 60 x 40 mm, about whose edges the ball rolls."""
    half, lines = np.array([0.04, 0.03, 0.02]), []
    for axis in range(3):
        u, v = (k for k in range(3) if k != axis)
        corner = np.sign(np.column_stack([np.cos(TURN), np.sin(TURN)]))
        way = np.column_stack([np.cos(TURN), np.sin(TURN)])
        way /= np.max(np.abs(way) / half[[u, v]], axis=1, keepdims=True)
        rolled = corner * half[[u, v]] + TIP * np.column_stack([np.cos(TURN), np.sin(TURN)])
        flat = np.abs(way) >= half[[u, v]] * (1.0 - 1e-12)
        section = np.concatenate([np.where(flat, way + TIP * np.sign(way), way), rolled])
        for level in np.linspace(-0.9, 0.9, 5):
            line = np.zeros((len(section), 3))
            line[:, [u, v]], line[:, axis] = section, level * half[axis]
            lines.append(line)
    return lines


def valley(angle: float) -> list[FloatArray]:
    """Lines of ball centres down one side of a valley along y and up the other."""
    x = np.linspace(-0.05, 0.05, 400)
    return [
        np.column_stack([x, 0.0 * x + y, np.abs(x) * np.tan(angle) + TIP / np.cos(angle)])
        for y in np.linspace(-0.03, 0.03, 9)
    ]


def missed(base: Base, lines: list[FloatArray]) -> FloatArray:
    return np.abs(base.foot(np.concatenate(lines), TIP).height)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("lines", "kind"), [pytest.param(egg(), "star body", marks=pytest.mark.slow), (vase(), "tube")]
)
def test_a_round_body_of_no_family_is_fitted_to_the_noise(lines: list[FloatArray], kind: str) -> None:
    base = fit_base(swept(lines))
    assert base.kind == kind
    assert np.quantile(missed(base, lines), 0.95) < 1.5 * NOISE


@pytest.mark.slow
def test_a_crest_does_not_draw_a_star_body_to_itself() -> None:
    bare, lifted = np.concatenate(egg(31)), np.concatenate(egg(31, 6e-4))
    base = fit_base(swept(egg(31, 6e-4)))
    height = base.foot(lifted, TIP).height
    assert np.abs(height - np.linalg.norm(lifted - bare, axis=1)).max() < 5e-5


@pytest.mark.slow
def test_the_same_trace_gives_the_same_star_body() -> None:
    once, again = (fit_base(swept(egg())).surface for _ in range(2))
    np.testing.assert_array_equal(once.vertices, again.vertices)


@pytest.mark.slow
def test_a_block_has_its_six_faces_and_explains_the_way_round_its_edges() -> None:
    lines = around_block()
    base = fit_base(swept(lines))
    assert base.kind == "polyhedron"
    assert len(base.parameters["normals"]) == 6
    assert missed(base, lines).max() < NOISE
    np.testing.assert_allclose(base.surface.bounds, [[-0.04, -0.03, -0.02], [0.04, 0.03, 0.02]], atol=NOISE)
    middle = base.nearest.query([[0.0, 0.0, 0.0]])
    assert middle.side[0] < 0, "the inside is inside"


def test_a_valley_keeps_its_crease() -> None:
    lines = valley(np.radians(20.0))
    base = fit_base(swept(lines))
    assert base.kind == "extrusion"
    assert base.parameters["radii"] == [0.0]
    assert missed(base, lines).max() < 2.0 * NOISE


def bowl() -> list[FloatArray]:
    """Ball centres inside the lower part of a sphere of 60 mm radius about the origin."""
    polar = np.linspace(-0.6, 0.6, 300)
    return [
        (0.06 - TIP)
        * np.column_stack([np.sin(polar) * np.cos(tilt), 0.0 * polar + np.sin(tilt), -np.cos(polar) * np.cos(tilt)])
        for tilt in np.linspace(-0.5, 0.5, 11)
    ]


@pytest.mark.parametrize("felt", [False, True])
def test_a_bowl_is_felt_from_inside(felt: bool) -> None:
    lines = bowl()
    inward = [-line / np.linalg.norm(line, axis=1, keepdims=True) for line in lines]
    base = fit_base(swept(lines, inward if felt else None))
    assert base.kind == "sphere"
    assert base.parameters["hollow"]
    assert base.parameters["radius"] == pytest.approx(0.06, abs=1e-4)
    raised = np.array([[0.0, 0.0, -0.06 + TIP + 1e-3]])
    assert base.foot(raised, TIP).height[0] == pytest.approx(1e-3, abs=1e-4), "a bump in a bowl is a bump"


def test_a_bore_is_a_hollow_cylinder_where_the_contacts_say_so() -> None:
    levels = np.linspace(-0.04, 0.04, 15)
    away = np.column_stack([np.cos(TURN), np.sin(TURN), 0.0 * TURN])
    lines = [0.02 * away + [0.0, 0.0, level] for level in levels]
    base = fit_base(swept(lines, [-away for _ in levels]))
    assert base.kind == "cylinder"
    assert base.parameters["radius"] == pytest.approx(0.03, abs=NOISE)
    assert missed(base, lines).max() < NOISE
    assert fit_base(swept(lines)).parameters["radius"] == pytest.approx(0.01, abs=NOISE), "else it is a rod"


def test_a_sheet_follows_as_many_waves_as_it_has_pieces_for() -> None:
    # five waves, each of twelve radii
    x = np.linspace(0.0, 0.6, 2000)
    lines = [
        np.column_stack([x, np.full_like(x, y), 1.5e-3 * np.sin(2.0 * np.pi * x / 0.12) + TIP])
        for y in np.linspace(0.0, 0.08, 9)
    ]
    trace = swept(lines)
    fit = sheet(Cloud.of(trace, 4000), shortest=2.5)
    assert fit is not None and np.median(np.abs(fit.residual)) < 2.0 * NOISE
    base = Base(fit.surface(Cloud.of(trace, 4000), None), fit.kind, fit.parameters)
    assert np.median(missed(base, lines)) < NOISE


@pytest.mark.parametrize(("pieces", "taken"), [((3, 1), 0.0), ((21, 6), 0.15e-3)])
def test_what_a_sheet_took_of_a_detail_that_it_was_fitted_through_is_told(
    pieces: tuple[int, int], taken: float
) -> None:
    """A dent of 0.5 mm: pieces as short as half of it take a third of it, long ones none."""
    x, y = (each.ravel() for each in np.meshgrid(np.arange(0.0, 0.16, 2e-4), np.linspace(0.0, 0.05, 21)))
    dent = -0.5e-3 * np.exp(-((x - 0.075) ** 2 + (y - 0.025) ** 2) / (2.0 * 0.004**2))
    centers = np.column_stack([x, y, dent + 2e-3 * np.sin(2.0 * np.pi * x / 0.04) * (pieces[0] > 3)])
    centers += 1e-5 * np.random.default_rng(8).standard_normal(centers.shape)
    trace = Trace(np.arange(float(len(x))), centers, np.repeat(np.arange(21), 800), 3e-3)
    rise = sheet_moved(trace, pieces, np.array([[0.075, 0.025, -3e-3]]), 12.4e-3)
    assert rise == pytest.approx(taken, abs=max(0.4 * taken, 2e-6))
