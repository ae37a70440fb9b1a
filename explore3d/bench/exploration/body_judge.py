"""Judge of a run on a body: what ball and carrier can reach, what was swept, what sank how deep; by brute force.

Nothing of the planner or of its geometry decides here: distances from the true object are libigl's, free space is a
grid that is filled from outside, directions of the carrier are tried one after the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from explore3d.analysis import Analysis, TrueFeature
from explore3d.log import Event
from hw import THROUGH_SPACE
from mapping import BoolArray, FloatArray, IntArray, Surface
from mapping.geometry.mesh import nearest_on

# Spacing of the places that are asked, and of the grid of free space, in tip radii
ASKED_SPACING, FREE_SPACE_SPACING = 0.25, 0.5
# How deep something may sink, in tip radii
MAY_SINK = 0.05
# A finger backs off so far from what it touched, in tip radii
BACKED_OFF = 0.5
# The stem: half as thick as the ball, from where it leaves the ball to six radii behind the ball's centre, tip radii
STEM_THICK, STEM_FROM, STEM_TO, STEM_ASKED = 0.5, 1.5, 6.0, 10
# The carrier leans from the normal by as much as the sensor's field of 75 degrees leaves over a detail a sixth of a tip
# radius high, whose contact leaves the body's normal by arccos(1 - 1/6) = 34 degrees
LEANS = float(np.radians(41.0))
LEANING_DIRECTIONS = 400
# A place was touched from its own side if the normals are closer than this
OWN_SIDE_COSINE = float(np.cos(np.radians(60.0)))
# Samples whose mean tells where the ball was, of a finger with noise
SAMPLES_AVERAGED = 8
# A feature can be reached if the ball can touch so much of its course
REACHED_COURSE = 0.9


@dataclass(frozen=True, eq=False)
class Judge:
    """The true object, and the ball and stem that were to touch it.

    Args:
        object: as it is.
        tip_radius: m.
    """

    object: Surface
    tip_radius: float

    def distance(self, points: FloatArray) -> FloatArray:
        """(N,) distance from the object's surface, m; negative inside of it."""
        return self._nearest(points)[0]

    @cached_property
    def reachable(self) -> BoolArray:
        """(N,) which of the asked places ball and stem can touch, coming from outside."""
        radius = self.tip_radius
        places, normals, _ = self.asked
        centers = places + radius * normals
        can = self.distance(centers) >= (1.0 - MAY_SINK) * radius
        can &= self._from_outside(centers)
        blocked = np.flatnonzero(can)
        blocked = blocked[~self._stem_free(centers[blocked], normals[blocked])]
        for direction in _directions(LEANING_DIRECTIONS):
            tried = blocked[normals[blocked] @ direction >= np.cos(LEANS)]
            free = self._stem_free(centers[tried], np.tile(direction, (len(tried), 1)))
            blocked = np.setdiff1d(blocked, tried[free])
        can[blocked] = False
        return np.asarray(can)

    def swept(self, centers: FloatArray, reach: float) -> BoolArray:
        """(N,) which of the asked places lie within reach (m) of a place that the ball (M, 3) touched, on its side."""
        from scipy.spatial import cKDTree

        _, touched = self._nearest(centers)
        up = centers - touched
        up /= np.maximum(np.linalg.norm(up, axis=1, keepdims=True), 1e-12)
        places, normals, _ = self.asked
        tree = cKDTree(touched)
        near = tree.query_ball_point(places, reach)
        pairs = zip(near, normals, strict=True)
        return np.array([bool((up[which] @ normal).max(initial=-1.0) >= OWN_SIDE_COSINE) for which, normal in pairs])

    def share(self, which: BoolArray) -> float:
        """Share of the reachable surface on which this holds."""
        weights = self.asked[2] * self.reachable
        return float(weights[which].sum() / weights.sum())

    def feature_reachable(self, true: TrueFeature) -> bool:
        """True if the ball can touch nearly all of a feature's course."""
        from scipy.spatial import cKDTree

        places, _, _ = self.asked
        crest = cKDTree(places).query(true.axis)[1]
        return bool(self.reachable[crest].mean() >= REACHED_COURSE)

    def sinking(self, moves: Sequence[dict[str, Any]], swept: Sequence[FloatArray]) -> tuple[float, float]:
        """How deep the ball sank on its ways and where it swept, and the stem on its ways and sweeps; tip radii.

        Args:
            moves: as the log has them, executed.
            swept: centres of the ball (M, 3) that each sweep measured, m.
        """
        radius = self.tip_radius
        # asked in one go: libigl sorts the object's faces anew each time
        ball, stem = [np.zeros((0, 3))], [(np.zeros((0, 3)), np.zeros((0, 3)))]
        for before, after in zip([None, *moves], moves, strict=False):
            path, approach = (np.asarray(after[name], dtype=np.float64).reshape(-1, 3) for name in ("path", "approach"))
            parts = [] if after["purpose"] == "sweep" else [(path, approach)]
            stem_parts = [(path, approach)]
            if before is not None:
                ends = np.stack([np.asarray(before["approach"]).reshape(-1, 3)[-1], approach[0]])
                # fingers back off from what was touched; travel begins and ends in free space
                off = np.array([[0.0 if move["purpose"] in THROUGH_SPACE else BACKED_OFF] for move in (before, after)])
                way = np.stack([np.asarray(before["path"])[-1], path[0]]) - off * radius * ends
                parts.append((way, ends))
                stem_parts.append((way, ends))
            ball.extend(_dense(*part, 0.1 * radius)[0] for part in parts)
            stem.extend(_dense(*part, 0.25 * radius) for part in stem_parts)
        for centers in swept:
            count = len(centers) // SAMPLES_AVERAGED
            if count:
                ball.append(centers[: count * SAMPLES_AVERAGED].reshape(count, SAMPLES_AVERAGED, 3).mean(axis=1))
        places, along = (np.concatenate(parts) for parts in zip(*stem, strict=True))
        nearest = self.distance(np.concatenate(ball)).min(initial=np.inf)
        stem_nearest = self._stem_distance(places, -along).min(initial=np.inf)
        return 1.0 - float(nearest) / radius, STEM_THICK - float(stem_nearest) / radius

    @cached_property
    def asked(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Places (N, 3) m evenly over the object, outward normals (N, 3), and the area that each stands for, m^2."""
        return _spread(self.object, ASKED_SPACING * self.tip_radius)

    def _nearest(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Signed distances (N,) and nearest points (N, 3), m."""
        import igl

        by = igl.SIGNED_DISTANCE_TYPE_PSEUDONORMAL
        distance, _, nearest, _ = igl.signed_distance(np.ascontiguousarray(points), *self._arrays, by)
        return np.asarray(distance), np.asarray(nearest)

    @cached_property
    def _arrays(self) -> tuple[FloatArray, IntArray]:
        return np.array(self.object.vertices), np.array(self.object.faces)

    def _stem_distance(self, centers: FloatArray, away: FloatArray) -> FloatArray:
        """(N,) distance of the stem's axis behind balls (N, 3), directions (N, 3) away from the body, m."""
        back = np.linspace(STEM_FROM, STEM_TO, STEM_ASKED) * self.tip_radius
        axis = centers[:, None, :] + back[:, None] * away[:, None, :]
        return np.asarray(self.distance(axis.reshape(-1, 3)).reshape(len(centers), -1).min(axis=1))

    def _stem_free(self, centers: FloatArray, away: FloatArray) -> BoolArray:
        if not len(centers):
            return np.zeros(0, dtype=bool)
        return np.asarray(self._stem_distance(centers, away) >= (STEM_THICK - MAY_SINK) * self.tip_radius)

    def _from_outside(self, centers: FloatArray) -> BoolArray:
        """(N,) True where a ball is next to free space that is open to the outside."""
        from scipy.ndimage import label
        from scipy.spatial import cKDTree

        radius = self.tip_radius
        spacing = FREE_SPACE_SPACING * radius
        low, high = self.object.bounds[0] - 3.0 * radius, self.object.bounds[1] + 3.0 * radius
        axes = [np.arange(a, b + spacing, spacing) for a, b in zip(low, high, strict=True)]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        free = (self.distance(grid.reshape(-1, 3)) >= (1.0 - MAY_SINK) * radius).reshape(grid.shape[:3])
        part, _ = label(free, structure=np.ones((3, 3, 3)))
        outside = grid[free & (part == part[0, 0, 0])]
        distance, _ = cKDTree(outside).query(centers)
        return np.asarray(distance <= np.sqrt(3.0) * spacing)


def refusals(events: Sequence[Event]) -> dict[str, Any]:
    """Moves made, moves refused, and how often two in a row were refused for one cause."""
    what = [e.data["what"].partition(": ")[2] if e.kind == "refused" else "" for e in events if e.kind in _MOVES]
    kinds = ["".join(c for c in each if c.isalpha() or c == " ") for each in what]
    twice = sum(a != "" and a == b for a, b in pairwise(kinds))
    return {"moves": kinds.count(""), "refused": len(kinds) - kinds.count(""), "refused_twice": twice}


_MOVES = ("move", "refused")


def anchors_right(analysis: Analysis, tip_radius: float) -> int:
    """How many found features hang where they are: on the face that they name, on the true feature's course."""
    surface, right = analysis.model.base.surface, 0
    for row in analysis.errors:
        if row.status != "found" or row.found is None or row.true is None or row.found.anchor is None:
            continue
        anchor = row.found.anchor
        place = anchor.barycentric @ surface.vertices[surface.faces[anchor.face]]
        strip = np.sqrt(2.0 * tip_radius * abs(row.true.height))
        off = np.linalg.norm(place - nearest_on(place[None], row.true.axis)[0][0])
        right += bool(np.linalg.norm(place - anchor.position) < 1e-6 and off < strip)
    return right


def _spread(surface: Surface, spacing: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Places on every face, at most about `spacing` m apart: each face cut into n^2 equal ones, their middles."""
    corners = surface.vertices[surface.faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    parts = np.maximum(1, np.ceil(longest / spacing).astype(np.int64))
    places, owners = [], []
    for n in np.unique(parts):
        faces = np.flatnonzero(parts == n)
        i, j = (index.ravel() for index in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
        upright = i + j < n
        u, v = np.where(upright, i + 1 / 3, n - i - 1 / 3) / n, np.where(upright, j + 1 / 3, n - j - 1 / 3) / n
        places.append(np.einsum("sk,fkx->fsx", np.column_stack([1 - u - v, u, v]), corners[faces]).reshape(-1, 3))
        owners.append(np.repeat(faces, n * n))
    owner = np.concatenate(owners)
    return np.concatenate(places), surface.face_normals[owner], (surface.face_areas / parts**2)[owner]


def _dense(path: FloatArray, approach: FloatArray, spacing: float) -> tuple[FloatArray, FloatArray]:
    """A polyline and its approaches with places put between, at most `spacing` m apart."""
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    count = np.maximum(1, np.ceil(steps / spacing).astype(np.int64))
    place = np.append(np.concatenate([np.zeros(0), *(k + np.arange(n) / n for k, n in enumerate(count))]), len(steps))
    number = np.arange(len(path))
    centers, along = (
        np.column_stack([np.interp(place, number, values[:, axis]) for axis in range(3)])
        for values in (path, np.broadcast_to(approach, path.shape))
    )
    return centers, along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)


def _directions(count: int) -> FloatArray:
    """(count, 3) unit vectors, evenly over the sphere."""
    number = np.arange(count) + 0.5
    z, turn = 1.0 - 2.0 * number / count, np.pi * (1.0 + np.sqrt(5.0)) * number
    return np.column_stack([np.sqrt(1.0 - z**2) * np.cos(turn), np.sqrt(1.0 - z**2) * np.sin(turn), z])
