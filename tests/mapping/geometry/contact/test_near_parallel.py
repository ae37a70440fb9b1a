"""Balls that move almost along faces slip through no crack between them, whatever the mesh (theory 4.7)."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from contact_bodies import box, merged, shared
from sunk import point_triangle, sunk

from mapping.arrays import FloatArray
from mapping.geometry.contact.first_contact import BallContact
from mapping.surface import Surface


def cylinder(radius: float, low: FloatArray, height: float, sides: int = 48) -> Surface:
    angles = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    ring = np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.zeros(sides)]) + low
    up = [0.0, 0.0, height]
    i, j = np.arange(sides), (np.arange(sides) + 1) % sides
    faces = [
        (i, j, sides + j),
        (i, sides + j, sides + i),
        (0 * i + 2 * sides, j, i),
        (0 * i + 2 * sides + 1, sides + i, sides + j),
    ]
    return Surface(
        np.concatenate([ring, ring + up, [low, low + up]]), np.concatenate([np.stack(face, 1) for face in faces])
    )


def part() -> Surface:
    """Boxes and cylinders one on another, as a CAD program tessellates them."""
    return merged(
        box((-1, -0.6, -0.2), (1, 0.6, 0)),
        box((-0.9, -0.5, 0), (-0.3, 0.5, 0.31)),
        box((0.5, 0.3, 0), (0.9, 0.55, 0.1)),
        cylinder(0.25, np.array([0.3, 0.1, 0.0]), 0.4),
        cylinder(0.11, np.array([0.75, -0.3, 0.0]), 0.2),
    )


def slivers() -> Surface:
    """A plate cut into strips, of which every second is 1e-4 down to 1e-13 wide."""
    widths = np.column_stack([np.full(10, 0.2), 10.0 ** -np.arange(4.0, 14.0)]).ravel()
    x = np.cumsum(np.concatenate([[-1.0], widths]))
    points = np.stack([np.column_stack([x, np.full(len(x), y), 1e-3 * x]) for y in (-1.0, 1.0)])
    i = np.arange(len(x) - 1)
    n = len(x)
    return Surface(
        points.reshape(-1, 3), np.concatenate([np.stack([i, i + 1, n + i + 1], 1), np.stack([i, n + i + 1, n + i], 1)])
    )


def caps() -> Surface:
    """A plate in strips of four triangles: the flattest, 1e-3 down to 1e-12 high, has a side that all but holds it."""
    points, faces = [], []
    for k in range(10):
        y, n = 0.2 * k - 1.0, len(points)
        points += [(-1.0, y), (1.0, y), (0.1, y + 10.0 ** (-3 - k)), (1.0, y + 0.2), (-1.0, y + 0.2)]
        faces += [(n, n + 1, n + 2), (n + 2, n + 1, n + 3), (n + 2, n + 3, n + 4), (n, n + 2, n + 4)]
    x, y = np.array(points).T
    return Surface(np.column_stack([x, y, 1e-3 * x + 2e-3 * y]), np.array(faces))


def turned(body: Surface) -> Surface:
    """Oblique to all axes: along them products have few digits to lose."""
    axes, _ = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))
    return Surface(body.vertices @ axes.T, body.faces)


BODIES = {
    "fandisk": lambda: shared("fandisk.off"),
    "part": part,
    "slivers": slivers,
    "turned_slivers": lambda: turned(slivers()),
    "turned_caps": lambda: turned(caps()),
}
JITTERS = (0.0, 1e-12, 1e-9, 1e-6)


def almost_along(body: Surface, radius: float, count: int, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Starts and directions: along faces or edges, tilted by 1e-17 to 1e-3, about as high as the ball's radius."""
    face = rng.integers(0, len(body.faces), count)
    weights = rng.dirichlet([1, 1, 1], count)
    kind = rng.integers(0, 4, count)
    weights[kind == 1, 2] = 0.0  # over an edge
    weights[kind == 2, 1:] = 0.0  # over a vertex
    weights /= weights.sum(axis=1, keepdims=True)
    corners, n = body.vertices[body.faces[face]], body.face_normals[face]
    edge = rng.random(count) < 0.3
    along = np.where(edge[:, None], corners[:, 1] - corners[:, 0], rng.normal(size=(count, 3)))
    along -= (along * n).sum(axis=1)[:, None] * n
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    tilt = 10.0 ** rng.uniform(-17, -3, count) * rng.choice([-1, 0, 1], count, p=[0.1, 0.1, 0.8])
    d = along - tilt[:, None] * n
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    high = radius * (1.0 + 10.0 ** rng.uniform(-17, -6, count) * rng.choice([-1, 0, 1], count))
    back = body.size * 10.0 ** rng.uniform(-3, 0, count)
    return np.einsum("ij,ijk->ik", weights, corners) + high[:, None] * n - back[:, None] * d, d


@pytest.mark.parametrize("count", [200, pytest.param(4200, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "jitter", [JITTERS[0], *(pytest.param(some, marks=pytest.mark.slow) for some in JITTERS[1:-1]), JITTERS[-1]]
)
@pytest.mark.parametrize("name", BODIES)
def test_a_ball_that_moves_almost_along_a_face_does_not_sink_in(name: str, jitter: float, count: int) -> None:
    body = BODIES[name]()
    rng = np.random.default_rng([count, JITTERS.index(jitter)])
    body = Surface(body.vertices + jitter * body.size * rng.normal(size=body.vertices.shape), body.faces)
    for ratio in (1e-3, 0.05):
        radius = ratio * body.size
        starts, d = almost_along(body, radius, count, rng)
        allowed = 1e-12 * radius + 2e-14 * body.size
        contacts = BallContact(body, radius).first_contact(starts, d)
        # a ball that starts within the tolerance of what touches may be sunk in so far
        free = ~contacts.overlap & (sunk(body, radius, starts, starts) <= 1e-15 * body.size)
        assert free.mean() > 0.2
        ends = np.where((contacts.count > 0)[:, None], contacts.centers, starts + 1.5 * body.size * d)
        assert sunk(body, radius, starts[free], ends[free]).max() <= allowed


def exact_height(p: FloatArray, corners: FloatArray) -> float:
    """Squared distance of p from a triangle's plane, in rational numbers."""
    a, u, v = ([Fraction(float(x)) for x in row] for row in (p, *corners[:2]))
    w = [Fraction(float(x)) for x in corners[2]]
    e, f, g = ([x - y for x, y in zip(q, u, strict=True)] for q in (v, w, a))
    n = [e[i - 2] * f[i - 1] - e[i - 1] * f[i - 2] for i in range(3)]
    return float(sum(x * y for x, y in zip(n, g, strict=True)) ** 2 / sum(x * x for x in n))


def test_the_judge_knows_planes_of_flat_triangles() -> None:
    body = turned(caps())
    flattest = np.arange(0, 32, 4)  # 1e-3 to 1e-10 high: feet of points over flatter ones slip off by rounding
    corners = body.vertices[body.faces[flattest]]
    points = corners.mean(axis=1) + 1e-3 * body.face_normals[flattest]
    found = point_triangle(*(array.astype(np.longdouble) for array in (points, *np.moveaxis(corners, 1, 0))))
    expected = [exact_height(*case) for case in zip(points, corners, strict=True)]
    np.testing.assert_allclose(np.sqrt(found.astype(float)), np.sqrt(expected), rtol=0, atol=1e-15)
