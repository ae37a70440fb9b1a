"""A mesh for a cloud of points, for what is computed on meshes only."""

from __future__ import annotations

import numpy as np

from mapping import FloatArray, Surface

# A cloud is a height field where no normal leans from the common one by more than its arc cosine (75 degrees).
LEAST_COSINE = 0.26
# Triangles with an edge longer than this many median edges bridge gaps of the cloud, where there is no surface.
LONGEST_EDGE_RATIO = 4.0


def meshed(points: FloatArray, normals: FloatArray | None) -> Surface | None:
    """Triangles between neighbouring points (N, 3), outward; None where neither way below applies.

    A cloud with normals (N, 3) is triangulated in the plane across their mean if none leans too far from it. One
    without is taken for what surrounds its centre, as its default normals are, and triangulated by the convex hull of
    its directions. The points stay where they are, so that vertices and points have the same numbers.
    """
    from scipy.spatial import ConvexHull, Delaunay, QhullError

    if len(points) < 4:
        return None
    try:
        if normals is None:
            away = points - points.mean(axis=0)
            length = np.linalg.norm(away, axis=1)
            if not (length > 0).all():
                return None
            away = away / length[:, None]
            faces, outward = ConvexHull(away).simplices.astype(np.int64), away
        else:
            mean = normals.mean(axis=0)
            mean = mean / (np.linalg.norm(mean) or 1.0)
            if not ((normals @ mean) > LEAST_COSINE * np.linalg.norm(normals, axis=1)).all():
                return None
            across = np.linalg.svd(mean[None, :])[2][1:]
            faces, outward = Delaunay(points @ across.T).simplices.astype(np.int64), np.broadcast_to(mean, points.shape)
            away = points
    except (QhullError, ValueError):  # points in one plane through the centre, on one line, or all the same
        return None
    corners = away[faces]
    turned = np.einsum(
        "fk,fk->f", np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), outward[faces[:, 0]]
    )
    faces = np.where((turned < 0)[:, None], faces[:, ::-1], faces)
    edges = np.linalg.norm(points[faces] - points[np.roll(faces, 1, axis=1)], axis=2)
    faces = faces[edges.max(axis=1) <= LONGEST_EDGE_RATIO * np.median(edges)]
    return Surface(points, faces) if len(faces) else None
