"""Where a course leaves its face of the body over a sharp edge, and the wall that the body goes on with there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import FloatArray
from mapping.base import WALL_COSINE, Base, Feet
from mapping.geometry.mesh import arclengths

# Places of a course lie so far apart at most, in tip radii, where it is asked whether it is still on its face: what
# turns by 45 degrees between two of them without an edge is as round as a third of a tip radius
ASKED_APART = 0.25
# And so high over the base, in tip radii: on the side of a thin body that it lies on
ASKED_ABOVE = 0.01
# A foot with no more than that of a corner's coordinate lies on the opposite side of its triangle
NO_SHARE = 1e-9
# Outward unit normal (3,) of the wall behind an edge; None: no edge was come to
Wall = FloatArray | None


@dataclass(frozen=True, eq=False)
class OnFace:
    """A course as far as its face of the body goes.

    Args:
        line, lift: (K, 3) points near the base, m, and outward unit normals; an edge that it comes to is its end.
        walls: behind the edges at its first and its last point.
    """

    line: FloatArray
    lift: FloatArray
    walls: tuple[Wall, Wall]


def up_to_edges(line: FloatArray, lift: FloatArray, base: Base, tip_radius: float) -> OnFace:
    """The stretch of a course about its middle that lies on one face of the body.

    Args:
        line: (K, 3) points near the base, in order, m.
        lift: (K, 3) outward unit normals there.
        base: the global model.
        tip_radius: radius of the fingertip, m.
    """
    s = arclengths(line)
    count = 1 + max(2, int(np.ceil(s[-1] / (ASKED_APART * tip_radius))))
    at = np.linspace(0.0, s[-1], count)
    places, up = (np.column_stack([np.interp(at, s, each[:, i]) for i in range(3)]) for each in (line, lift))
    feet = base.foot(places + ASKED_ABOVE * tip_radius * up, tip_radius)
    # normals of what was felt over an edge lean out, each as the ball lay there
    here = _normals_at(feet, count // 2, base)
    own = here[np.argmax(here @ up[count // 2])]
    first, last = (_crossed(places, feet, own, base, step) for step in (-1, 1))
    if first is None and last is None:
        return OnFace(line, lift, (None, None))
    low, high = at[first.before] if first else -np.inf, at[last.before] if last else np.inf
    inside = (s >= low) & (s <= high)
    line, lift = line[inside], lift[inside]
    if first:
        line, lift = np.vstack([first.point, line]), np.vstack([first.up, lift])
    if last:
        line, lift = np.vstack([line, last.point]), np.vstack([lift, last.up])
    return OnFace(line, lift, (first.wall if first else None, last.wall if last else None))


@dataclass(frozen=True, eq=False)
class _Crossed:
    """Where a course crosses an edge: the number of the last place before it, the point (3,) m, and the outward normals
    of the face that it leaves and of the wall."""

    before: int
    point: FloatArray
    up: FloatArray
    wall: FloatArray


def _crossed(places: FloatArray, feet: Feet, own: FloatArray, base: Base, step: int) -> _Crossed | None:
    """Where a course, gone along from its middle by steps of 1 or -1, crosses an edge first; None if nowhere.

    Args:
        places, feet: of the course, m.
        own: (3,) outward normal of the face in its middle.
        base: the global model.
        step: the way that it is gone.
    """
    middle, up = len(places) // 2, own
    for k in range(middle + step, len(places) if step > 0 else -1, step):
        before, here = k - step, _normals_at(feet, k, base)
        wall = here[np.argmin(here @ up)]
        if wall @ up > WALL_COSINE:
            up = here[np.argmax(here @ up)]
            continue
        start = places[before]
        way = start - places[before - step] if before != middle else places[k] - start
        out, gap = way @ wall, (feet.points[k] - start) @ wall
        if out > 0.0 and gap >= 0.0:
            return _Crossed(before, start + gap / out * way, up, wall)
    return None


def _normals_at(feet: Feet, k: int, base: Base) -> FloatArray:
    """(M, 3) outward unit normals of the faces that meet where the k-th foot lies."""
    surface, face = base.surface, feet.face[k]
    own, inside = surface.face_normals[face], feet.barycentric[k] > NO_SHARE
    if inside.all():
        return np.asarray(own[None])
    if inside.sum() == 1:
        corner = surface.faces[face, inside.argmax()]
        return np.asarray(surface.face_normals[(surface.faces == corner).any(axis=1)])
    mean = base.edge_normals[face, inside.argmin()]
    return np.asarray(np.stack([own, 2.0 * float(mean @ own) * mean - own]))
