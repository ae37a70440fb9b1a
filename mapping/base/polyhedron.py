"""Polyhedron: a block, a roof or a valley, whose faces are plane."""

from __future__ import annotations

import numpy as np

from mapping import FloatArray, IntArray, Surface
from mapping.base.base import Base
from mapping.base.quadrics import Cloud, Fitted

# Trial planes, each through a centre and two of so many that are next to it within so many tip radii
TRIALS, TRIAL_PLANE_REACH, TRIAL_PLANE_NEIGHBOURS = 300, 4.0, 128
# Centres so near to a plane belong to it, in tip radii; one of fewer than this share of all is none; the most planes
THICK, LEAST_PLANE_SHARE, MOST_PLANES = 0.03, 0.03, 12
# Rounds in which each plane is fitted again to the centres that touch nothing else
PLANE_FIT_ROUNDS = 6
# How far the planes' mean normal must point inward for a hollow body
HOLLOW = -0.3


def polyhedron(cloud: Cloud) -> Fitted | None:
    """Plane faces that meet in convex or in concave edges, about which the ball's centre goes as the ball does.

    None if the centres show fewer than two planes, or planes that bound no such body.
    """
    normals, offsets, share = _found(cloud)
    if len(normals) < 2:
        return None
    # turned so that the other centres lie below each plane: outward on a convex body, inward in a hollow one
    sign = -1.0 if _outwardness(normals, share, cloud) < HOLLOW else 1.0
    normals, offsets = _refined(normals, offsets, sign, cloud)
    bounded = _bounded(normals, offsets - sign * cloud.tip_radius, cloud)
    if bounded is None:
        return None
    vertices, faces, plane = bounded
    surface = Surface(vertices, faces if sign > 0 else faces[:, ::-1])
    missed = Base(surface).foot(cloud.points, cloud.tip_radius).height
    used = np.unique(plane)
    parameters = {"normals": (sign * normals[used] @ cloud.axes).tolist(), "hollow": sign < 0}
    return Fitted(
        "polyhedron", parameters, missed, 3 * len(used), lambda cloud, spacing: _fine(surface, cloud, spacing)
    )


def _found(cloud: Cloud) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Normals (K, 3), offsets (K,) m and shares (K,) of planes that many centres lie in, the largest first."""
    rest = cloud.points
    rng = np.random.default_rng(0)
    found: list[tuple[FloatArray, float, float]] = []
    while len(found) < MOST_PLANES and len(rest) > LEAST_PLANE_SHARE * len(cloud.points):
        normals, offsets = _trials(rest, cloud.tip_radius, rng)
        if not len(normals):
            break
        inside = np.abs(rest @ normals.T - offsets) < THICK * cloud.tip_radius
        best = inside[:, int(inside.sum(axis=0).argmax())]
        if best.sum() < max(LEAST_PLANE_SHARE * len(cloud.points), 8):
            break
        normal, offset = _through(rest[best])
        if np.median(cloud.points @ normal - offset) > 0:
            normal, offset = -normal, -offset
        found.append((normal, offset, float(best.mean())))
        rest = rest[np.abs(rest @ normal - offset) > 2.0 * THICK * cloud.tip_radius]
    normals, offsets, shares = (np.array([plane[k] for plane in found]) for k in range(3))
    return normals.reshape(-1, 3), offsets, shares


def _trials(points: FloatArray, tip_radius: float, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Planes through three centres that are near each other, but not in one line."""
    from scipy.spatial import cKDTree

    first = rng.integers(len(points), size=TRIALS)
    tree = cKDTree(points)
    count = min(TRIAL_PLANE_NEIGHBOURS, len(points))
    near = np.asarray(tree.query(points[first], count, distance_upper_bound=TRIAL_PLANE_REACH * tip_radius)[1])
    near = near.reshape(TRIALS, count)
    # neighbours that are too far have the number of all points
    known = (near < len(points)).sum(axis=1)
    two = (rng.random((2, TRIALS)) * known).astype(np.int64)
    second, third = near[np.arange(TRIALS), two]
    normals = np.cross(points[second] - points[first], points[third] - points[first])
    length = np.linalg.norm(normals, axis=1)
    wide = length > 0.25 * tip_radius**2
    normals = normals[wide] / length[wide, None]
    return normals, (normals * points[first[wide]]).sum(axis=1)


def _through(points: FloatArray) -> tuple[FloatArray, float]:
    """Normal (3,) and offset of the plane of least squares."""
    middle = points.mean(axis=0)
    normal = np.linalg.svd(points - middle, full_matrices=False)[2][2]
    return normal, float(normal @ middle)


def _outwardness(normals: FloatArray, share: FloatArray, cloud: Cloud) -> float:
    """Mean of the normals along the outward direction: of the contacts, or the frame's third axis."""
    outward = np.array([0.0, 0.0, 1.0])
    if cloud.outward is None:
        return float(share @ (normals @ outward) / share.sum())
    level = np.abs(cloud.points @ normals.T - (cloud.points @ normals.T).max(axis=0)).argmin(axis=1)
    return float((cloud.outward * normals[level]).sum(axis=1).mean())


def _refined(normals: FloatArray, offsets: FloatArray, sign: float, cloud: Cloud) -> tuple[FloatArray, FloatArray]:
    """The planes fitted to the centres that touch one plane alone; the ball on an edge tells nothing of either."""
    normals, offsets = normals.copy(), offsets.copy()
    for _ in range(PLANE_FIT_ROUNDS):
        over = cloud.points @ normals.T - offsets
        nearest = over.argmax(axis=1)
        # where the ball touches the plane nearest to it, seen from all others
        feet = cloud.points - sign * cloud.tip_radius * normals[nearest]
        beyond = feet @ normals.T - (offsets - sign * cloud.tip_radius)
        beyond[np.arange(len(beyond)), nearest] = -np.inf
        alone = beyond.max(axis=1) < 0 if sign > 0 else np.ones(len(beyond), dtype=bool)
        for k in range(len(normals)):
            own = alone & (nearest == k) & (np.abs(over[:, k]) < THICK * cloud.tip_radius)
            if own.sum() >= 8:
                normal, offset = _through(cloud.points[own])
                turned = 1.0 if normal @ normals[k] > 0 else -1.0
                normals[k], offsets[k] = turned * normal, turned * offset
    return normals, offsets


def _bounded(normals: FloatArray, offsets: FloatArray, cloud: Cloud) -> tuple[FloatArray, IntArray, IntArray] | None:
    """Vertices, faces and their planes, of the body below all planes, without what closes it beyond the cloud."""
    from scipy.optimize import linprog
    from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

    low, high = cloud.extent + cloud.margin * np.array([[-1.0], [1.0]])
    everything = np.vstack([normals, np.eye(3), -np.eye(3)])
    limits = np.concatenate([offsets, high, -low])
    # the middle of the largest ball inside
    design = np.column_stack([everything, np.ones(len(limits))])
    x = linprog([0.0, 0.0, 0.0, -1.0], design, limits, bounds=(None, None)).x
    if x is None or x[3] <= 0:
        return None
    try:
        corners = HalfspaceIntersection(np.column_stack([everything, -limits]), x[:3]).intersections
        corners = corners[np.unique(np.round(corners / (1e-9 * np.ptp(corners))), axis=0, return_index=True)[1]]
        hull = ConvexHull(corners)
    except QhullError:
        return None
    outer = hull.equations[:, :3]
    faces = hull.simplices.astype(np.int64)
    a, b, c = (corners[faces[:, k]] for k in range(3))
    wrong = (np.cross(b - a, c - a) * outer).sum(axis=1) < 0
    faces[wrong] = faces[wrong][:, ::-1]
    plane = (outer @ everything.T - 10.0 * np.abs(hull.equations[:, 3:] + limits) / np.ptp(corners)).argmax(axis=1)
    real = plane < len(normals)
    if not real.any():
        return None
    return corners, faces[real], plane[real]


def _fine(surface: Surface, cloud: Cloud, spacing: float | None) -> Surface:
    """The surface in the object frame, its triangles halved until none is longer than the spacing (m)."""
    import trimesh

    vertices, faces = surface.vertices, surface.faces
    sides = vertices[faces] - vertices[np.roll(faces, 1, axis=1)]
    longest = float(np.linalg.norm(sides, axis=2).max())
    halvings = 0 if spacing is None else int(np.clip(np.ceil(np.log2(longest / spacing)), 0, 6))
    for _ in range(halvings):
        vertices, faces = trimesh.remesh.subdivide(vertices, faces)
    return Surface(cloud.world(vertices), np.asarray(faces, dtype=np.int64))
