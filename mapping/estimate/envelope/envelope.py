"""Estimated surface: what the body must have been, from the path of the ball's centre."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from mapping import BoolArray, EnvelopeError, FloatArray, IntArray, Surface, Trace, lengths
from mapping.base import Base, LaidTrace
from mapping.estimate.envelope.alpha_shape import alpha_estimate
from mapping.estimate.envelope.bridging import bridged_faces, rest_between, resting_points, split
from mapping.estimate.envelope.estimate import Estimate
from mapping.estimate.envelope.profile_envelope import penetration_below
from mapping.estimate.envelope.proof import Balls, owners_along
from mapping.estimate.envelope.sweep_mesh import sweep_faces
from mapping.estimate.sweeps import (
    BRIDGED,
    EXTRAPOLATED,
    LABELS,
    TOUCHED,
    ContactRow,
    Directions,
    Smoothed,
    SurfaceNormals,
    at_kinks,
    in_plane,
    pitch,
    smooth,
    thinned,
    unit,
)
from mapping.instrument import Noise

__all__ = ["BRIDGED", "EXTRAPOLATED", "LABELS", "TOUCHED", "EnvelopeError", "Estimate", "estimate_surface"]


ENVELOPE_METHODS = ("envelope", "contact", "normals", "alpha")
# Balls may overlap a contact by this share of their radius before it counts as impossible.
OVERLAP_TOLERANCE = 1e-9
# The doubt of a slope is an estimate, no bound: it must be this much smaller than what would be harmless.
CAUTION = 2.0
# Points are touched by default if the body is proven to be within so many of their distances: a contact between two
# others lies within half a distance, the last of a row within one and a half, for only one side bounds it.
# Balls that may overlap a contact by s are as good as so much further apart: 2 sqrt(r s) (theory section 4.8).
STEPS_TOLERATED = 2.0
# More points of a mesh than this cost memory and minutes of curvature, on bodies that no picture shows so finely.
MOST_POINTS = 300_000
# Contacts that are laid out together before they are thinned: 10 MB with all that is known of them, and twice that to
# join and to thin them. One sweep of few samples at a time would take as long again for the calls alone
CONTACTS_AT_ONCE = 2**16


def estimate_surface(
    trace: Trace,
    method: str = "envelope",
    *,
    base: Base | None = None,
    outward: ArrayLike | None = None,
    noise: Noise | None = None,
    spacing: float | None = None,
    tolerance: float | None = None,
) -> Estimate:
    """The surface of the body under a trace, every point labelled with how certain it is.

    Args:
        method: "envelope": the envelope of the balls, from positions alone; "contact": centre - r normal by
            recorded contact normals; "normals": the paper's equation 12, with the normals of the traced surface itself
            and no regard to its kinks; "alpha": the envelope of unorganised balls, whose corners bound the body
            but are nowhere called touched.
        base, outward: which side the finger is on: the base, or (3,) or (N, 3) directions away from the body.
            Without both, recorded normals, else +z.
        noise: if given, the trace is smoothed at the scale that this noise demands (paper, section 3.3);
            without it the trace is taken as exact, and ball operators on noise are biased.
        spacing: distance to which points are thinned along the sweeps, m; None takes all points of a single
            sweep and a quarter of the distance between several, or more where that were more than MOST_POINTS.
        tolerance: points are called touched if the body is proven to come as near, m, and no others. From positions
            alone no proof is finer than half the distance between the sweeps (theory section 4.8). None takes
            what the distance between points can prove, and calls touched only single contacts whose neighbours
            leave no doubt of the slope.

    Returns:
        The estimate, with what is proven of every point; contacts that lie inside another ball are impossible and
        left out.

    Raises:
        EnvelopeError: an unknown method, no samples, a tolerance that is no length, "contact" without recorded
            normals, or no possible contact.

    Reference: the paper, sections 2.2 and 3.3, equation 12; theory sections 1, 4 and 4.8.
    """
    if method not in ENVELOPE_METHODS:
        raise EnvelopeError(f"unknown method {method!r}; possible: {', '.join(ENVELOPE_METHODS)}")
    if len(trace) == 0:
        raise EnvelopeError("cannot estimate a surface from a trace of no samples")
    if tolerance is not None and not (np.isfinite(tolerance) and tolerance >= 0):
        raise EnvelopeError(f"the tolerance of touched points must be a length in metres; found {tolerance!r}")
    if method == "contact" and trace.normals is None:
        raise EnvelopeError("method 'contact' needs recorded contact normals; this trace has positions alone")
    slack = OVERLAP_TOLERANCE * trace.tip_radius
    smoothed = None
    if noise is not None and noise.sd > 0:
        smoothed = smooth(trace, noise, outward=_directions(trace, base, outward))
        trace, away = smoothed.trace, smoothed.outward
        slack = max(slack, 4 * smoothed.sd)
    else:
        away = _outward(trace, base, outward)
    known = None
    if method == "contact" and trace.normals is not None:
        known = trace.centers - trace.tip_radius * unit(trace.normals)
    balls = Balls(trace.centers, trace.sweep, away, trace.tip_radius, slack, known)
    if method == "alpha":
        estimate = alpha_estimate(balls, tolerance)
        return estimate if smoothed is None else replace(estimate, sd=smoothed.sd)
    depth = penetration_below(trace.centers, trace.tip_radius)
    points = _possible(_contacts(trace, method, away, slack, smoothed), depth, slack, _Thinning.of(trace, spacing))
    estimate, faces, resting = _meshed(points, trace.tip_radius, slack, depth)
    estimate = _proven(estimate, faces, resting, balls, smoothed, tolerance)
    if smoothed is None:
        return estimate
    own = estimate.sample >= 0
    return replace(estimate, sample=np.where(own, smoothed.sample[estimate.sample], -1), sd=smoothed.sd)


def _proven(
    estimate: Estimate,
    faces: IntArray,
    resting: IntArray,
    balls: Balls,
    smoothed: Smoothed | None,
    tolerance: float | None,
) -> Estimate:
    """The estimate with what is proven of its points, and labels that say no more.

    Args:
        faces: (F, 3) the mesh of its first points, before those of the resting ball were added.
        resting: (K, 3) the points whose balls meet in the others.
    """
    count = len(estimate.points) - len(resting)
    spot = estimate.sample[:count]
    if smoothed is not None:  # where a kink was smoothed over the centres are none of a ball that touched
        spot = np.where((spot >= 0) & ~smoothed.dented[spot], spot, -1)
    lone = len(np.unique(estimate.sweep)) < 2
    across = unit(np.cross(balls.outward[estimate.sample], _along(estimate))) if lone else None
    near = _resolution(estimate, count, balls) if tolerance is None else tolerance
    owners = np.vstack(
        [owners_along(estimate.sweep[:count], spot), np.pad(resting, ((0, 0), (0, 1)), constant_values=-1)]
    )
    below, above = balls.reach(estimate.points, owners, spot, faces, across, near)
    if smoothed is not None:
        below, above = below + balls.slack, above + balls.slack
    sure = below <= near
    if tolerance is None:
        sure &= estimate.labels == TOUCHED
        labels = np.where((estimate.labels == TOUCHED) & ~sure, EXTRAPOLATED, estimate.labels)
    else:
        labels = np.where(sure, TOUCHED, np.where(estimate.labels == BRIDGED, BRIDGED, EXTRAPOLATED))
    return replace(estimate, labels=labels.astype(np.int8), below=below, above=above, tolerance=near)


def _along(estimate: Estimate) -> FloatArray:
    """(N, 3) directions of a lone sweep at its points."""
    steps = np.gradient(estimate.centers, axis=0) if len(estimate.centers) > 1 else np.zeros_like(estimate.centers)
    return np.asarray(steps)


def _resolution(estimate: Estimate, count: int, balls: Balls) -> float:
    """What so many first points, so far apart, can tell of the place of a contact, m."""
    points, sweep = estimate.points[:count], estimate.sweep[:count]
    apart = pitch(points, sweep)
    if apart == 0 and count > 1:
        apart = float(np.median(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    return STEPS_TOLERATED * (apart + 2 * float(np.sqrt(balls.tip_radius * balls.slack)))


@dataclass
class _Thinning:
    """Points of sweeps as they come, thinned to a distance along them.

    Args:
        step: distance, m; 0 keeps all.
        given: True if it was asked for; else more than MOST_POINTS are thinned out further.
        length: along all points so far, m.
        last: the last point.
    """

    step: float
    given: bool
    length: float = 0.0
    last: FloatArray | None = None

    @classmethod
    def of(cls, trace: Trace, spacing: float | None) -> _Thinning:
        """To what was asked for, or a quarter of the distance between the sweeps."""
        return cls(pitch(trace.centers, trace.sweep) / 4, False) if spacing is None else cls(spacing, True)

    def thin(self, points: Estimate) -> Estimate:
        """The next points thinned by their own distances, not by their balls': over a sharp edge many balls share one
        contact."""
        if not len(points.points):
            return points
        way = points.points if self.last is None else np.vstack([self.last, points.points])
        self.length += float(lengths(np.diff(way, axis=0)).sum())
        self.last = points.points[-1]
        return points.select(thinned(points.points, points.sweep, self.step, _bounding(points)))

    def all_of_them(self, points: Estimate) -> Estimate:
        """All points that were thinned, no more of them than anybody sees."""
        least = self.length / MOST_POINTS
        if self.given or self.step >= least or self.step == 0:
            return points
        return points.select(thinned(points.points, points.sweep, least, _bounding(points)))


def _possible(
    sweeps: Iterable[Estimate], depth: Callable[[FloatArray, float], FloatArray], slack: float, thinning: _Thinning
) -> Estimate:
    """The contacts that lie in no other ball, thinned; some sweeps at a time, so that only these are ever held.

    Raises:
        EnvelopeError: no contact is possible.
    """
    kept, sweeps = list[Estimate](), iter(sweeps)
    while some := _some(sweeps):
        points = Estimate.joined(some)
        some.clear()
        possible = depth(points.points, slack) <= slack
        kept.append(thinning.thin(points if possible.all() else points.select(np.flatnonzero(possible))))
    points = Estimate.joined(kept)
    if not len(points.points):
        raise EnvelopeError("every contact lies inside another ball: the trace is no ball's path; give its noise")
    return thinning.all_of_them(points)


def _some(sweeps: Iterator[Estimate]) -> list[Estimate]:
    """The next sweeps with CONTACTS_AT_ONCE contacts or a few more; none at the end."""
    taken: list[Estimate] = []
    count = 0
    for sweep in sweeps:
        taken.append(sweep)
        count += len(sweep.points)
        if count >= CONTACTS_AT_ONCE:
            break
    return taken


def _directions(trace: Trace, base: Base | None, outward: ArrayLike | None) -> FloatArray | Directions:
    """Directions away from the body: over a base those of any centre, between what is known of the trace on it."""
    if outward is not None or base is None:
        return _outward(trace, base, outward)
    return LaidTrace.of(trace, base).directions()


def _outward(trace: Trace, base: Base | None, outward: ArrayLike | None) -> FloatArray:
    """(N, 3) directions away from the body."""
    if outward is not None:
        return np.array(np.broadcast_to(np.asarray(outward, dtype=np.float64), trace.centers.shape))
    if base is not None:
        return LaidTrace.of(trace, base).feet().normals
    if trace.normals is not None:
        return trace.normals
    return np.array(np.broadcast_to([0.0, 0.0, 1.0], trace.centers.shape))


def _contacts(
    trace: Trace, method: str, outward: FloatArray, slack: float, smoothed: Smoothed | None
) -> Iterator[Estimate]:
    """Contacts of one sweep after another, and points of the resting ball at its interference points; no mesh yet."""
    moving = np.r_[True, (np.diff(trace.centers, axis=0) != 0).any(axis=1) | (np.diff(trace.sweep) != 0)]
    still = None
    if not moving.all():  # a finger that stands still says everything once
        still = np.flatnonzero(moving)
        trace, outward = trace.select(still), outward[still]
    del moving
    surface = SurfaceNormals(trace, outward, slack, open_kinks=method != "normals")
    for number, part in enumerate(surface.parts):
        row, normals, across, doubt = surface.of(number)
        if method == "contact" and part.normals is not None:
            normals, doubt = _recorded(part, row), np.zeros(len(doubt))
        # A ball turned by an angle about its contact leaves the body by half of r angle^2.
        uncertain = (row.labels == TOUCHED) & (0.5 * trace.tip_radius * (CAUTION * doubt) ** 2 > slack)
        labels = np.where(uncertain, EXTRAPOLATED, row.labels).astype(np.int8)
        sample = np.where(row.sample < 0, -1, row.sample + surface.starts[number])
        if still is not None:
            sample = np.where(sample < 0, -1, still[sample])
        points, sweep = row.centers - trace.tip_radius * normals, np.full(len(sample), part.sweep[0])
        found = Estimate.unproven(points, normals, row.centers, labels, sample, sweep, across)
        yield found if smoothed is None else _dented(found, smoothed)


def _bounding(points: Estimate) -> BoolArray:
    """(N,) which points are the contacts at interference points: they bound a bridged strip, however sure they are."""
    bridged = np.pad(points.labels == BRIDGED, 1)
    return np.asarray((points.sample < 0) & ~bridged[1:-1] & (bridged[:-2] | bridged[2:]))


def _recorded(trace: Trace, row: ContactRow) -> FloatArray:
    """Recorded normals at the samples; at interference points they are continued, and made to fit the tangents."""
    recorded = np.zeros_like(trace.centers) if trace.normals is None else trace.normals
    normals = np.where((row.sample >= 0)[:, None], recorded[row.nearest], row.normals)
    ends, continued = at_kinks(trace, row, recorded)
    normals[ends] = in_plane(row.tangents[ends], continued)
    return normals


def _dented(points: Estimate, smoothed: Smoothed) -> Estimate:
    """Points of a smoothed trace; what may be a kink is bridged."""
    dented = (points.sample >= 0) & smoothed.dented[points.sample]
    return replace(points, labels=np.where(dented, BRIDGED, points.labels).astype(np.int8))


def _meshed(
    points: Estimate, r: float, slack: float, depth: Callable[[FloatArray, float], FloatArray]
) -> tuple[Estimate, IntArray, IntArray]:
    """The points joined as their centres lie (those never coincide), with resting points in bridged faces.

    Returns:
        The estimate, (F, 3) its faces without resting points, and (K, 3) the points whose balls meet in those.
    """
    nothing = np.zeros((0, 3), dtype=np.int64)
    if len(np.unique(points.sweep)) < 2:
        return points, nothing, nothing
    faces = sweep_faces(points.centers, points.sweep, points.normals, points.points)
    if len(faces) == 0:
        return points, nothing, nothing
    flagged = bridged_faces(points.centers, points.normals, faces, r, points.across)
    # Faces at an opened interference point hold their bridged points already.
    chosen = np.flatnonzero(flagged & (points.sample[faces] >= 0).all(axis=1))
    resting = resting_points(points.centers, points.normals, faces[chosen], r)
    corners = points.centers[faces[chosen]]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1, initial=0.0)
    # Samples between the three corners lower the balls' common boundary by up to this sagitta.
    possible = depth(resting, slack) <= slack + longest**2 / (2 * r)
    possible &= rest_between(resting, points.centers, points.normals, faces[chosen])
    chosen, resting = chosen[possible], resting[possible]
    joined = points.with_resting(resting, faces[chosen])
    surface = Surface(joined.points, split(faces, chosen, len(points.points)))
    return replace(joined, surface=surface), faces, faces[chosen]
