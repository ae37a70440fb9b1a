"""Onto the base: points near a base moved along smooth normals until they lie on it, as far as no wall begins.

A wall is a face that rises out of the base beside a feature: in the corner a ball leaps from one to the other.
"""

from __future__ import annotations

import numpy as np

from mapping import BoolArray, FloatArray
from mapping.base.base import Base, Feet

# Each round leaves of a sideways error the share by which facet and smooth normal differ: 1e-2 for 1 degree, but a
# third beside a fold of 40 degrees, where rounds go on until a point moves by less than this share of the tip's radius.
FEWEST_PROJECTION_ROUNDS, MOST_PROJECTION_ROUNDS, SETTLED_POINT_MOVE = 2, 12, 1e-4
# A sideways error of less than this share of the tip's radius is rounding, as over a plane: no round takes it out
SIDEWAYS_ROUNDING = 1e-12
# Cosine of the angle by which a face is turned at least to be a wall. What is taken together of feet on both sides of a
# blunter corner, as by a bin, stands in mid-air by r (1 - cos 22.5 deg) = 0.08 r at most
WALL_COSINE = float(np.cos(np.radians(45.0)))


def onto_base(
    points: FloatArray, normals: FloatArray, base: Base, tip_radius: float, *, smooth: int = 0
) -> tuple[FloatArray, FloatArray]:
    """Points of the base on the normals' lines through points near it, and the outward unit normals there.

    The foot of a ball's centre lies sideways of it on a mesh: by r sin(0.75 deg) = 0.05 mm for r = 4 mm and facets
    that meet at 1.5 deg. The first foot is sought from above, which tells the two sides of a thin body apart; each
    further round takes its sideways error out. The normals are those of the smooth body that the facets stand for: a
    ball's centre is r times as far beside what stands on a facet's own as that leans.

    Args:
        points: (N, 3) points near the base, m.
        normals: (N, 3) unit normals to move along, outward.
        base: the global model.
        tip_radius: radius of the fingertip, m.
        smooth: the base's normals are averaged over this many neighbours before and after.
    """
    feet = base.foot(points + tip_radius * normals, tip_radius)
    smoothed = base.smooth_normals(feet)
    sign = np.where(np.einsum("ij,ij->i", smoothed, normals) < 0.0, -1.0, 1.0)
    up = averaged(smoothed * sign[:, None], smooth)
    found, moving = feet.points.copy(), np.ones(len(points), dtype=bool)
    for done in range(MOST_PROJECTION_ROUNDS):
        gap = points - found
        sideways = gap - np.einsum("ij,ij->i", gap, up)[:, None] * up
        left = np.flatnonzero(moving & (np.abs(sideways).max(axis=1, initial=0.0) > SIDEWAYS_ROUNDING * tip_radius))
        if not len(left):
            break
        before = found[left]
        found[left] = base.foot(before + sideways[left] + 1e-3 * tip_radius * up[left], tip_radius).points
        # a foot that stays, as on the border of a base that ends before the point, is found again by every round
        moving[left] = (found[left] != before).any(axis=1)
        move = float(np.abs(found[left] - before).max())
        if done + 1 >= FEWEST_PROJECTION_ROUNDS and move < SETTLED_POINT_MOVE * tip_radius:
            break
    return found, up


def averaged(normals: FloatArray, neighbours: int) -> FloatArray:
    """Unit normals (N, 3) averaged over that many neighbours on either side, fewer at the ends."""
    if neighbours < 1 or len(normals) < 3:
        return normals
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(normals, axis=0)])
    here = np.arange(len(normals))
    half = np.minimum(neighbours, np.minimum(here, here[::-1]))
    mean = total[here + half + 1] - total[here - half]
    return np.asarray(mean / np.linalg.norm(mean, axis=1, keepdims=True))


def on_walls(feet: Feet, crest: FloatArray, normals: FloatArray) -> BoolArray:
    """Which balls rest on a wall: the base under them faces elsewhere than under a feature, and rises above it.

    Args:
        feet: N places of the ball.
        crest: (K, 3) points of the base under the feature, m.
        normals: (K, 3) outward unit normals there.

    Returns:
        (N,) True for those.
    """
    from scipy.spatial import cKDTree

    turned = [np.arccos(np.clip((of @ normals[0]).min(), -1.0, 1.0)) for of in (feet.normals, normals)]
    if sum(turned) < np.arccos(WALL_COSINE):
        return np.zeros(len(feet.height), dtype=bool)
    nearest = cKDTree(crest).query(feet.points)[1]
    away = np.einsum("ij,ij->i", feet.normals, normals[nearest]) < WALL_COSINE
    return np.asarray(away & (np.einsum("ij,ij->i", feet.points - crest[nearest], normals[nearest]) > 0.0))


def between_walls(line: FloatArray, normals: FloatArray, base: Base, tip_radius: float) -> slice:
    """The stretch of a line about its middle over which a ball does not touch a wall that the line runs into.

    Args:
        line: (K, 3) points near the base, in order, m.
        normals: (K, 3) outward unit normals there.
        base: the global model.
        tip_radius: radius of the fingertip, m.
    """
    middle, count = len(line) // 2, len(line)
    if 2.0 * np.arccos(np.clip((base.surface.face_normals @ normals[0]).min(), -1.0, 1.0)) < np.arccos(WALL_COSINE):
        return slice(0, count)  # no two faces of it are turned so far from each other
    up = base.foot(line + tip_radius * normals, tip_radius).normals
    # as the base lies under the place before it, seen from the middle: a line that was led on to a wall stands on it
    before = np.clip(np.where(np.arange(count) < middle, np.arange(count) + 1, np.arange(count) - 1), 0, count - 1)
    feet = base.foot(line + tip_radius * up[before], tip_radius)
    turned = np.einsum("ij,ij->i", feet.normals, up[before]) < WALL_COSINE
    walls = np.flatnonzero(turned & (np.einsum("ij,ij->i", feet.points - line[before], up[before]) > 0.0))
    return slice(int(walls[walls < middle].max(initial=-1)) + 1, int(walls[walls > middle].min(initial=count)))
