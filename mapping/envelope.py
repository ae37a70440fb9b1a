"""Estimated surface: what the body must have been, from the path of the ball's centre."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mapping.base import Base
from mapping.contact_row import ContactRow, contact_row
from mapping.estimate import BRIDGED, EXTRAPOLATED, LABELS, TOUCHED, EnvelopeError, Estimate
from mapping.noise import Noise
from mapping.penetration import penetration
from mapping.surface import Surface
from mapping.sweep_mesh import pitch, sweep_faces, thinned
from mapping.trace import Trace

__all__ = ["BRIDGED", "EXTRAPOLATED", "LABELS", "TOUCHED", "EnvelopeError", "Estimate", "estimate_surface"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

METHODS = ("envelope", "contact", "normals")
# Balls may overlap a contact by this share of their radius before it counts as impossible.
TOLERANCE = 1e-9


def estimate_surface(
    trace: Trace,
    method: str = "envelope",
    *,
    base: Base | None = None,
    outward: ArrayLike | None = None,
    noise: Noise | None = None,
    spacing: float | None = None,
) -> Estimate:
    """The surface of the body under a trace, every point labelled with how certain it is.

    Args:
        method: "envelope": the envelope of the balls, from positions alone; "contact": centre - r normal by
            recorded contact normals; "normals": equation 12, with the normals of the traced surface itself
            and no regard to its kinks.
        base, outward: which side the finger is on: the base, or (3,) or (N, 3) directions away from the body.
            Without both, recorded normals, else +z.
        noise: if given, the trace is smoothed at the scale that this noise demands (paper, section 3.3);
            without it the trace is taken as exact, and ball operators on noise are biased.
        spacing: distance to which points are thinned along the sweeps, m; None takes all points of a single
            sweep and a quarter of the distance between several.

    Returns:
        The estimate; contacts that lie inside another ball are impossible and left out.

    Raises:
        EnvelopeError: an unknown method, no samples, "contact" without recorded normals, or no possible contact.

    Reference: the paper, sections 2.2 and 3.3, equation 12; theory sections 1 and 4.
    """
    if method not in METHODS:
        raise EnvelopeError(f"unknown method {method!r}; possible: {', '.join(METHODS)}")
    if len(trace) == 0:
        raise EnvelopeError("cannot estimate a surface from a trace of no samples")
    if method == "contact" and trace.normals is None:
        raise EnvelopeError("method 'contact' needs recorded contact normals; this trace has positions alone")
    away, slack = _outward(trace, base, outward), TOLERANCE * trace.tip_radius
    smoothed = None
    if noise is not None and noise.sd > 0:
        from mapping.smoothing import smooth

        smoothed = smooth(trace, noise, outward=away)
        trace, away = smoothed.trace, away[smoothed.sample]
        slack = max(slack, 4 * smoothed.sd)
    row, sweep, sample = _contacts(trace, method, away)
    labels = row.labels.copy()
    if smoothed is not None:
        # At the scale of smoothing, dents beyond half the tip's own curvature look like kinks.
        own = sample >= 0
        labels[own] = np.where(smoothed.curvature[sample[own]] * trace.tip_radius < -1, BRIDGED, labels[own])
        sample = np.where(own, smoothed.sample[sample], -1)
    points = row.centers - trace.tip_radius * row.normals
    possible = penetration(points, trace.centers, trace.tip_radius) <= slack
    if not possible.any():
        raise EnvelopeError("every contact lies inside another ball: the trace is no ball's path; give its noise")
    step = pitch(trace.centers, trace.sweep) / 4 if spacing is None else spacing
    kept = np.flatnonzero(possible)
    kept = kept[thinned(row.centers[kept], sweep[kept], step, row.sample[kept] < 0)]
    surface = _mesh(row.centers[kept], points[kept], sweep[kept], row.normals[kept])
    return Estimate(surface, points[kept], row.normals[kept], row.centers[kept], labels[kept], sample[kept], sweep[kept])


def _outward(trace: Trace, base: Base | None, outward: ArrayLike | None) -> FloatArray:
    """(N, 3) directions away from the body."""
    if outward is not None:
        return np.array(np.broadcast_to(np.asarray(outward, dtype=np.float64), trace.centers.shape))
    if base is not None:
        return base.foot(trace.centers, trace.tip_radius).normals
    if trace.normals is not None:
        return trace.normals
    return np.array(np.broadcast_to([0.0, 0.0, 1.0], trace.centers.shape))


def _contacts(trace: Trace, method: str, outward: FloatArray) -> tuple[ContactRow, IntArray, IntArray]:
    """The rows of all sweeps as one, the sweep number of each point, and its sample in the trace."""
    from mapping.trace_normals import surface_normals

    rows, sweeps, samples, nearest, start = [], [], [], [], 0
    for number, part in trace.sweeps():
        own = slice(start, start + len(part))
        row = contact_row(part.centers, outward[own], trace.tip_radius, open_kinks=method != "normals")
        rows.append(row)
        sweeps.append(np.full(len(row.centers), number))
        samples.append(np.where(row.sample < 0, -1, row.sample + start))
        nearest.append(row.nearest + start)
        start += len(part)
    row = ContactRow.joined(rows)
    sweep, sample, near = np.concatenate(sweeps), np.concatenate(samples), np.concatenate(nearest)
    if method == "contact" and trace.normals is not None:
        normals = np.where((sample >= 0)[:, None], trace.normals[near], row.normals)
        return row.with_normals(normals), sweep, sample
    return row.with_normals(surface_normals(trace, row, sample, near, outward)), sweep, sample


def _mesh(centers: FloatArray, points: FloatArray, sweep: IntArray, normals: FloatArray) -> Surface | None:
    """The mesh of the contacts, joined as the centres lie: distances between centres never vanish."""
    if len(np.unique(sweep)) < 2:
        return None
    faces = sweep_faces(centers, sweep, normals)
    return Surface(points, faces) if len(faces) else None
