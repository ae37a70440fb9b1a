"""Alpha shape: the envelope of balls at unorganised centres, from positions alone.

Reference: Edelsbrunner and Mücke, Three-dimensional alpha shapes, ACM Transactions on Graphics 13, 1994; theory
section 1.2.
"""

from __future__ import annotations

import numpy as np

from mapping import EnvelopeError, FloatArray, IntArray, Surface
from mapping.estimate.envelope.bridging import resting_points
from mapping.estimate.envelope.estimate import Estimate
from mapping.estimate.envelope.proof import Balls
from mapping.estimate.envelope.sweep_mesh import oriented, sweep_faces
from mapping.estimate.sweeps import EXTRAPOLATED, TOUCHED

EMPTY_BALL_TOLERANCE = 1e-9  # of the radius, by which balls through three centres may hold a fourth


def alpha_facets(centers: FloatArray, outward: FloatArray, tip_radius: float) -> tuple[IntArray, FloatArray]:
    """Triples of balls that meet on the boundary of all of them, on the body's side.

    The points of the boundary that lie on three balls are centres of empty balls of the same radius through
    three ball centres: exactly the facets of the alpha shape for alpha = r, all of which are Delaunay.

    Args:
        centers: (N, 3) ball centres, m, in any order.
        outward: (N, 3) directions away from the body.

    Returns:
        (F, 3) indices of the centres, counter-clockwise from outside, and (F, 3) where their balls meet, m.

    Raises:
        EnvelopeError: fewer than three centres, or all on one line.
    """
    from scipy.spatial import Delaunay, QhullError, cKDTree

    kept = np.unique(centers, axis=0, return_index=True)[1]
    local = (centers[kept] - centers[kept].mean(axis=0)) / tip_radius
    # Centres in one plane have no tetrahedra of their own: far points on both sides make some.
    axis = outward.sum(axis=0)
    axis = axis / np.linalg.norm(axis) if np.linalg.norm(axis) > 1e-6 * len(axis) else np.array([0.0, 0.0, 1.0])
    far = (10.0 * (1.0 + float(np.abs(local).max()))) * np.vstack([axis, -axis])
    try:
        cells = Delaunay(np.vstack([local, far])).simplices
    except QhullError as error:
        raise EnvelopeError(f"{len(kept)} different ball centres on one line enclose no surface") from error
    facets = np.concatenate([np.delete(cells, k, axis=1) for k in range(4)])
    facets = np.unique(np.sort(facets, axis=1), axis=0).astype(np.int64)
    facets = facets[(facets < len(kept)).all(axis=1)]
    met = resting_points(local, outward[kept], facets, 1.0)
    near = np.abs(np.linalg.norm(met - local[facets[:, 0]], axis=1) - 1.0) <= EMPTY_BALL_TOLERANCE
    facets, met = facets[near], met[near]
    empty = (
        np.asarray(cKDTree(local).query(met)[0]) >= 1.0 - EMPTY_BALL_TOLERANCE if len(met) else np.zeros(0, dtype=bool)
    )
    return oriented(centers, kept[facets[empty]], outward), met[empty] * tip_radius + centers[kept].mean(axis=0)


def alpha_estimate(balls: Balls, tolerance: float | None) -> Estimate:
    """The envelope of balls as an estimate: its corners, meshed as a cloud.

    Args:
        balls: in any order.
        tolerance: within which corners count as touched, m; None calls none touched, for positions alone do not tell
            where on its ball's patch the body is.

    Raises:
        EnvelopeError: the balls enclose no surface, for example because they lie further apart than they reach.
    """
    facets, points = alpha_facets(balls.centers, balls.outward, balls.tip_radius)
    if len(points) == 0:
        raise EnvelopeError(f"no three balls of radius {balls.tip_radius:g} m meet: they lie too far apart")
    first = facets[:, 0]
    normals = (balls.centers[first] - points) / balls.tip_radius
    faces = sweep_faces(points, np.arange(len(points)), normals)
    below, above = balls.reach(points, facets, np.arange(len(balls.centers)), facets, None, 0.0)
    near = below <= (-1.0 if tolerance is None else tolerance)
    return Estimate(
        Surface(points, faces) if len(faces) else None,
        points,
        normals,
        balls.centers[first],
        np.where(near, TOUCHED, EXTRAPOLATED).astype(np.int8),
        np.full(len(points), -1),
        balls.sweep[first],
        np.full(len(points), np.nan),
        below,
        above,
        tolerance=0.0 if tolerance is None else tolerance,
    )
