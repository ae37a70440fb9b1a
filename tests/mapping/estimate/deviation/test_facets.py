"""Facets that stand for something round are rounded out; flats stay flat; what was felt decides."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.arrays import FloatArray
from mapping.base import Base
from mapping.estimate.deviation import explain
from mapping.estimate.deviation.facets import Facets, round_out
from mapping.geometry.contact import BallContact
from mapping.surface import Surface
from mapping.trace import Trace

TIP, RADIUS, NOISE = 3e-3, 20e-3, 1e-6


def prism(sides: int, low: float = -20e-3, high: float = 40e-3) -> Surface:
    """A shaft in so many flats whose corners lie on it, closed at its ends."""
    turn = 2.0 * np.pi * np.arange(sides) / sides
    ring = RADIUS * np.column_stack([np.cos(turn), np.sin(turn)])
    below, above = (np.column_stack([ring, np.full(sides, z)]) for z in (low, high))
    ends = [[0.0, 0.0, low], [0.0, 0.0, high]]
    here = np.arange(sides)
    there = (here + 1) % sides
    sides_ = [[here, there, there + sides], [here, there + sides, here + sides]]
    lids = [[there, here, np.full(sides, 2 * sides)], [here + sides, there + sides, np.full(sides, 2 * sides + 1)]]
    return Surface(np.concatenate([below, above, ends]), np.concatenate([np.stack(f, axis=1) for f in sides_ + lids]))


def rings(radius: FloatArray | float, seed: int = 0) -> Trace:
    """Ten rings of 1500 samples at a distance from the axis, with noise along it."""
    rng, turn = np.random.default_rng(seed), np.linspace(0.0, 2.0 * np.pi, 1500, endpoint=False)
    rows = []
    for k in range(10):
        r = radius + NOISE * rng.standard_normal(1500)
        rows.append(np.column_stack([r * np.cos(turn), r * np.sin(turn), np.full(1500, 2e-3 * k)]))
    return Trace(np.arange(15000.0), np.concatenate(rows), np.repeat(np.arange(10), 1500), TIP)


@pytest.mark.parametrize("sides", [40, 256])
def test_flats_of_a_round_shaft_are_rounded_out(sides: int) -> None:
    bulge = RADIUS * (1.0 - np.cos(np.pi / sides))
    trace, base = rings(RADIUS + TIP), Base(prism(sides))
    found = explain(trace, base)
    assert found is not None and found.causes == ("facets",)
    assert found.facets == pytest.approx(bulge, rel=0.05)
    assert "stand for a round body" in found.sentence()
    # drawn as the map of the deviation, and told as what was typical before and is left
    assert found.heights.max() == pytest.approx(bulge, rel=0.05) and found.heights.min() > -0.01 * bulge
    assert len(found.heights) == len(found.base.surface.vertices)
    if bulge > 10.0 * NOISE:
        assert found.rms > 0.3 * bulge > 10.0 * found.left
    left = found.base.foot(trace.centers, TIP).height
    assert left.std() < 1.05 * NOISE and abs(left.mean()) < 0.2 * NOISE
    assert not found.base.surface.open_sides.any(), "no gap opens"


def test_normals_of_facets_of_a_ball_are_the_balls() -> None:
    """Weighted by angles those of an icosphere are 5 mrad off, and a ball in facets of 2 mm up to 4 um."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=2, radius=1.0)
    base = Base(Surface(ball.vertices, ball.faces))
    normals = base.nearest.corner_normals(np.arange(len(ball.faces)))
    np.testing.assert_allclose(normals, ball.vertices[ball.faces], atol=1e-12)


@pytest.mark.slow
def test_flats_that_were_felt_as_flats_stay() -> None:
    surface = prism(40)
    centers = rings(RADIUS + 4.0 * TIP).centers
    inward = -centers / np.linalg.norm(centers[:, :2], axis=1)[:, None] * [1.0, 1.0, 0.0]
    felt = BallContact(surface, TIP).first_contact(centers, inward).centers
    felt = np.asarray(felt) - NOISE * np.random.default_rng(1).standard_normal(len(felt))[:, None] * inward
    trace = Trace(np.arange(15000.0), felt, np.repeat(np.arange(10), 1500), TIP)
    assert round_out(trace, Base(surface)) is None


def test_a_flat_beside_what_is_round_stays_flat() -> None:
    """Half a shaft on a block, as drawings with fillets have it: corners where both meet lean to both."""
    turn, low = np.linspace(0.0, np.pi, 25), -40e-3
    arc = RADIUS * np.column_stack([np.cos(turn), np.sin(turn)])
    outline = np.concatenate([arc, [[-RADIUS, low], [RADIUS, low]]])
    count = len(outline)
    here = np.arange(count)
    there = (here + 1) % count
    walls = [[here, here + count, there], [there, here + count, there + count]]
    surface = Surface(
        np.concatenate([np.insert(outline, 1, y, axis=1) for y in (-20e-3, 40e-3)]),
        np.concatenate([np.stack(each, axis=1) for each in walls]),
    )
    rng, rows = np.random.default_rng(2), []
    down, over, reach = np.linspace(0.0, -30e-3, 400), np.linspace(0.0, np.pi, 900), RADIUS + TIP
    for k in range(10):
        up_one = np.column_stack([np.full(400, reach), down[::-1]])
        round_ = reach * np.column_stack([np.cos(over), np.sin(over)])
        path = np.concatenate([up_one, round_, np.column_stack([np.full(400, -reach), down])])
        path *= 1.0 + NOISE / RADIUS * rng.standard_normal((len(path), 1))
        rows.append(np.insert(path, 1, 2e-3 * k, axis=1))
    centers = np.concatenate(rows)
    trace = Trace(np.arange(float(len(centers))), centers, np.repeat(np.arange(10), len(rows[0])), TIP)
    before, found = Base(surface).foot(centers, TIP).height, round_out(trace, Base(surface))
    assert found is not None
    left = found.base.foot(centers, TIP).height
    flat, top = centers[:, 2] < -8e-3, centers[:, 2] > 8e-3
    assert before[top].std() > 10.0 * NOISE
    # as much where both meet
    assert left[flat].std() < 1.5 * NOISE and left[~flat].std() < 1.5 * NOISE and np.abs(left).max() < 6.0 * NOISE


@pytest.mark.parametrize("radius", [1e-3, 5e-3, 30e-3])
@pytest.mark.parametrize("hollow", [False, True])
def test_the_body_over_facets_of_a_ball_is_the_ball(radius: float, hollow: bool) -> None:
    """Felt from outside and, where the fingertip fits in, from inside: to a hundredth of what the facets are off."""
    import trimesh

    if hollow and radius < TIP:
        return
    ball = trimesh.creation.icosphere(subdivisions=3, radius=radius)
    base = Base(Surface(ball.vertices, ball.faces[:, ::-1] if hollow else ball.faces))
    towards = np.random.default_rng(1).standard_normal((4000, 3))
    reach = radius - TIP if hollow else radius + TIP
    centers = reach * towards / np.linalg.norm(towards, axis=1, keepdims=True)
    feet = base.foot(centers, TIP)
    body = Facets.of(base, np.arange(len(ball.faces)))
    over = body.distance(centers, feet.face, feet.barycentric) - TIP
    assert np.abs(over).max() < 0.02 * np.abs(feet.height).max()


def test_over_edges_of_a_block_the_body_is_the_block() -> None:
    block = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    import trimesh

    hull = trimesh.convex.convex_hull(0.01 * block)
    base = Base(Surface(hull.vertices, hull.faces))
    towards = np.random.default_rng(1).standard_normal((2000, 3))
    centers = 0.03 * towards / np.linalg.norm(towards, axis=1, keepdims=True)
    near = base.nearest.query(centers)
    body = Facets.of(base, np.arange(len(hull.faces)))
    np.testing.assert_allclose(body.distance(centers, near.face, near.barycentric), near.distance, atol=1e-15)
