"""Details laid on any body: its mesh is refined where they lie, and displaced along the body's normals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from explore3d.analysis import TrueFeature
from explore3d.bench.scenes.bodies import Mesh
from mapping import BoolArray, FloatArray, IntArray, Surface
from mapping.detection import in_cells
from mapping.geometry.mesh import NearestPoint, nearest_on

# Longest edge within a detail, in widths of it, where its section bulges, which is where the ball touches: at the crest
# of a cos^2 section H high facets lie H (0.05 pi)^2 / 4 = 0.006 H inside it at most, 3 um of 0.5 mm, and a third of it
# in the mean. With twice as long ones a run on the folds found a groove of 16 mm 0.18 mm too long, and no groove that
# fitted
BULGING_EDGE = 0.05
# And where it is hollow, which a ball of the size that explores it spans
HOLLOW_EDGE = 0.1
# Beyond a detail edges may grow by so much for each metre that they lie away from it
EDGE_GROWTH = 0.7
# What is drawn on a body: kind, height, width and length, m (0: a point)
DRAWN = (
    ("ridge", 0.5e-3, 2e-3, 18e-3),
    ("ridge", 0.5e-3, 2e-3, 14e-3),
    ("groove", -0.5e-3, 3.5e-3, 16e-3),
    ("bump", 0.6e-3, 3e-3, 0.0),
    ("bump", 0.6e-3, 3e-3, 0.0),
)
# Room around a drawn course in which the body turns by at most so much (m, rad): no crease, no limb thinner than it
SMOOTH_ROOM, SMOOTH_TURN = 2.5e-3, float(np.radians(35.0))
# Courses stay so far apart, m: two contact half-widths of 1.8 mm, and both half-widths
DETAILS_APART = 7e-3
COURSE_STEP = 0.5e-3
MOST_DRAWS = 2000
# Share of the ball's radius by which it may sink elsewhere where it rests on a course
COURSE_SINKING = 0.03


@dataclass(frozen=True, eq=False)
class Detail:
    """What stands out of a body, or is cut into it.

    Args:
        kind: of the feature.
        course: (K, 3) on the body, m; K = 1 for a point.
        up: (K, 3) outward unit normals there.
        height: at the crest, signed, m; beside it the section is height cos^2 (pi distance / width).
        width: m.
    """

    kind: str
    course: FloatArray
    up: FloatArray
    height: float
    width: float

    @property
    def truth(self) -> TrueFeature:
        """The feature that a finger should find."""
        return TrueFeature(self.kind, self.course, self.height, self.width)

    def distance(self, points: FloatArray) -> FloatArray:
        """(N,) distance from the course, m."""
        return np.asarray(np.linalg.norm(points - nearest_on(points, self.course)[0], axis=1))


def laid_on(body: Mesh, details: Sequence[Detail]) -> Mesh:
    """The body with its details; where none is, its faces are where they were.

    Edges longer than a detail's section allows are halved, the longest of a triangle first, on both their sides, so
    that the mesh stays closed and no angle gets smaller than half of the smallest there was (Rivara 1984). The top of a
    detail about a point becomes a corner, or the mesh would cut it off: up to 9 um of bumps of 0.6 mm.
    """
    vertices, faces = body
    short = np.zeros(0, dtype=np.int64)
    while True:
        edges, number = _edges(faces)
        ends = vertices[edges]
        length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        # corners keep their numbers: an edge that was short enough before is
        name = edges @ np.array([1 << 32, 1])
        new = np.flatnonzero(~np.isin(name, short))
        too_long = np.zeros(len(edges), dtype=bool)
        too_long[new] = length[new] > _allowed(ends[new].mean(axis=1), details)
        if not too_long.any():
            break
        short = name[~too_long]
        vertices, faces = _halved(vertices, faces, edges, number, length, too_long)
    for detail in details:
        if len(detail.course) == 1:
            vertices, faces = _with_corner(vertices, faces, detail.course)
    raised = vertices.copy()
    normals = Surface(vertices, faces).face_normals
    outward = np.zeros_like(vertices)
    np.add.at(outward, faces.ravel(), np.repeat(normals, 3, axis=0))
    for detail in details:
        distance = detail.distance(vertices)
        near = np.flatnonzero(distance < 0.5 * detail.width)
        up = detail.up[np.linalg.norm(vertices[near, None] - detail.course, axis=2).argmin(axis=1)]
        same_side = (outward[near] * up).sum(axis=1) > 0
        section = detail.height * np.cos(np.pi * distance[near] / detail.width) ** 2
        raised[near] += np.where(same_side, section, 0.0)[:, None] * up
    return raised, faces


def _with_corner(vertices: FloatArray, faces: IntArray, place: FloatArray) -> Mesh:
    """The mesh with its point nearest to a place (1, 3) as a corner: of three faces where there was one."""
    near = NearestPoint(Surface(vertices, faces)).query(place)
    a, b, c = faces[near.face[0]]
    new = len(vertices)
    parts = np.array([[a, b, new], [b, c, new], [c, a, new]])
    return np.concatenate([vertices, near.points]), np.concatenate([np.delete(faces, near.face[0], axis=0), parts])


def _allowed(points: FloatArray, details: Sequence[Detail]) -> FloatArray:
    """(N,) longest edge about these places, m."""
    allowed = np.full(len(points), np.inf)
    for detail in details:
        distance = detail.distance(points)
        within = np.minimum(distance, 0.5 * detail.width)
        bulges = detail.height * np.cos(2.0 * np.pi * within / detail.width) > 0.0
        finest = np.where(bulges, BULGING_EDGE, HOLLOW_EDGE) * detail.width
        allowed = np.minimum(allowed, np.maximum(finest, EDGE_GROWTH * (distance - 0.5 * detail.width)))
    return allowed


def _edges(faces: IntArray) -> tuple[IntArray, IntArray]:
    """Edges (E, 2), and which (F, 3) follow each face's corners."""
    both = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    edges, number = np.unique(np.sort(both, axis=1), axis=0, return_inverse=True)
    return edges, number.reshape(-1, 3)


def _halved(
    vertices: FloatArray, faces: IntArray, edges: IntArray, number: IntArray, length: FloatArray, halve: BoolArray
) -> Mesh:
    """The mesh with those edges halved, and with each of them the longest edge of its triangles."""
    turn = length[number].argmax(axis=1)
    order = (turn[:, None] + np.arange(3)) % 3
    faces, number = np.take_along_axis(faces, order, axis=1), np.take_along_axis(number, order, axis=1)
    halve = halve.copy()
    while (more := halve[number].any(axis=1) & ~halve[number[:, 0]]).any():
        halve[number[more, 0]] = True
    middle = np.where(halve, len(vertices) + np.cumsum(halve) - 1, -1)
    vertices = np.concatenate([vertices, vertices[edges[halve]].mean(axis=1)])
    (a, b, c), (m, n, p) = faces.T, middle[number].T
    kept, first, second = m < 0, n >= 0, p >= 0
    split = ~kept
    parts = [
        (kept, (a, b, c)),
        (split & ~first, (m, b, c)),
        (split & first, (m, b, n)),
        (split & first, (m, n, c)),
        (split & ~second, (a, m, c)),
        (split & second, (a, m, p)),
        (split & second, (m, c, p)),
    ]
    return vertices, np.concatenate([np.stack(corners, axis=1)[mask] for mask, corners in parts])


def drawn_details(body: Surface, tip_radius: float, rng: np.random.Generator) -> list[Detail]:
    """Two ridges, a groove and two bumps at places and in directions of chance, where the ball can rest on the body.

    Raises:
        ValueError: the body has no room for one of them.
    """
    ground = _Ground(body, tip_radius)
    details: list[Detail] = []
    for kind, height, width, length in DRAWN:
        for _ in range(MOST_DRAWS):
            course = ground.course(rng, length)
            if course is None:
                continue
            detail = Detail(kind, course[0], course[1], height, width)
            if all(other.distance(detail.course).min() > DETAILS_APART for other in details):
                details.append(detail)
                break
        else:
            raise ValueError(f"no room for a {kind} {1e3 * length:g} mm long on this body")
    return details


class _Ground:
    """A body on which courses are drawn."""

    def __init__(self, body: Surface, tip_radius: float) -> None:
        from scipy.spatial import cKDTree

        self.tip_radius = tip_radius
        self.nearest = NearestPoint(body)
        self.places, face = _places(body, 0.25 * SMOOTH_ROOM)
        self.normals = body.face_normals[face]
        weights = body.face_areas[face] / np.bincount(face)[face]
        self.share = np.cumsum(weights) / weights.sum()
        self.tree = cKDTree(self.places)

    def course(self, rng: np.random.Generator, length: float) -> tuple[FloatArray, FloatArray] | None:
        """A straightest course on smooth ground on which the ball can rest, and the normals; None if this is none."""
        start = int(np.searchsorted(self.share, rng.uniform()))
        point, up = self.places[start], self._up(self.places[start], self.normals[start])
        way = rng.standard_normal(3)
        if up is None:
            return None
        points, normals = [point], [up]
        for _ in range(round(length / COURSE_STEP)):
            way = way - (way @ normals[-1]) * normals[-1]
            way /= np.linalg.norm(way)
            foot = self.nearest.query((points[-1] + COURSE_STEP * way)[None])
            up = self._up(foot.points[0], foot.normals[0])
            if up is None:
                return None
            points.append(foot.points[0])
            normals.append(up)
        course, upward = np.array(points), np.array(normals)
        room = self.nearest.query(course + self.tip_radius * upward).distance
        return (course, upward) if room.min() >= (1.0 - COURSE_SINKING) * self.tip_radius else None

    def _up(self, point: FloatArray, normal: FloatArray) -> FloatArray | None:
        """Mean normal about a place of the body, None where it turns too much."""
        near = self.normals[self.tree.query_ball_point(point, SMOOTH_ROOM)]
        if not len(near) or (near @ normal).min() < np.cos(SMOOTH_TURN):
            return None
        mean = near.mean(axis=0)
        return np.asarray(mean / np.linalg.norm(mean))


def _places(body: Surface, spacing: float) -> tuple[FloatArray, IntArray]:
    """Points (N, 3) all over a body whose faces are cut into cells of their own shape, two in each, and their faces.

    Every place of chance follows from their order: they are cut alike whatever their shape, where the program's own
    sampler cuts thin faces in another way.
    """
    corners = body.vertices[body.faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    return in_cells(corners, np.ceil(longest / spacing).astype(np.int64))
