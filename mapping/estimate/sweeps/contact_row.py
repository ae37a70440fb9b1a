"""ContactRow: one sweep turned from ball centres into contacts, its interference points opened into fans."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from mapping import FloatArray, IntArray, lengths
from mapping.estimate.sweeps.kinks import NO_KINKS, Kinks, find_kinks
from mapping.estimate.sweeps.labels import BRIDGED, EXTRAPOLATED, TOUCHED
from mapping.estimate.sweeps.tangents import tangents, unit

# No more points than this across one bridged strip, however finely the sweep is sampled.
LARGEST_FAN = 64
# A gap this many times the usual spacing was not swept: the finger was lifted.
LIFTED = 8.0


@dataclass(frozen=True, eq=False)
class ContactRow:
    """Contacts of one sweep in order.

    Args:
        centers: (M, 3) ball centres, m.
        tangents: (M, 3) unit tangents of the trace.
        normals: (M, 3) outward unit normals; the contact is centre - tip_radius * normal.
        labels: (M,) TOUCHED, BRIDGED or EXTRAPOLATED.
        sample: (M,) index into the sweep, -1 for inserted rows.
        nearest: (M,) index of the sample that an inserted row belongs to, else `sample`.
    """

    centers: FloatArray
    tangents: FloatArray
    normals: FloatArray
    labels: NDArray[np.int8]
    sample: IntArray
    nearest: IntArray

    @classmethod
    def joined(cls, rows: Sequence[ContactRow]) -> ContactRow:
        """The rows one after another; sample numbers stay those of their own sweeps."""
        names = [item.name for item in fields(cls)]
        return cls(*(np.concatenate([getattr(row, name) for row in rows]) for name in names))

    def select(self, index: IntArray | slice) -> ContactRow:
        """The contacts of these indices; of a slice the arrays are parts of these."""
        return ContactRow(*(getattr(self, item.name)[index] for item in fields(self)))


def contact_row(centers: FloatArray, outward: FloatArray, tip_radius: float, open_kinks: bool = True) -> ContactRow:
    """The contacts of a sweep (N, 3) in the planes spanned by its tangents and `outward` (N, 3).

    At an interference point the ball touches with two normals. The row then holds both contacts and,
    between them, points of the resting ball: the strip below them cannot be reached (theory section 4).
    """
    kinks = find_kinks(centers, outward) if open_kinks else NO_KINKS
    spacing = lengths(np.diff(centers, axis=0))
    usual = float(np.median(spacing)) if len(spacing) else 0.0
    lifted = np.flatnonzero(spacing > LIFTED * usual) + 1
    kinks = _without(kinks, lifted)
    along = tangents(centers, np.union1d(kinks.cuts, lifted).astype(np.int64))
    count = len(centers)
    own = np.arange(count)
    parts = [(own.astype(float), centers, along, in_plane(along, outward), np.full(count, TOUCHED), own, own)]
    if len(kinks.cuts):
        parts.append(_fans(kinks, outward, tip_radius, usual))
    for cut in lifted:
        parts.append(_span(centers, parts[0][3], along, int(cut), usual))
    place, *columns = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.argsort(place, kind="stable")
    centers, along, normals, labels, sample, nearest = (column[order] for column in columns)
    return ContactRow(centers, along, normals, labels.astype(np.int8), sample, nearest)


def in_plane(along: FloatArray, outward: FloatArray) -> FloatArray:
    """Unit normals (N, 3) perpendicular to the tangents, in the plane of tangent and outward direction."""
    return unit(outward - np.einsum("ij,ij->i", outward, along)[:, None] * along)


_Part = tuple[FloatArray, FloatArray, FloatArray, FloatArray, IntArray, IntArray, IntArray]


def _fans(kinks: Kinks, outward: FloatArray, tip_radius: float, usual: float) -> _Part:
    """Both contacts of the ball at each kink, and points of the ball between them."""
    cuts = kinks.cuts
    first, last = in_plane(kinks.before, outward[cuts - 1]), in_plane(kinks.after, outward[cuts])
    angle = 2 * np.arcsin(np.minimum(1.0, np.linalg.norm(first - last, axis=1) / 2))
    inner = np.clip(np.ceil(tip_radius * angle / max(usual, 1e-300)) - 1, 1, LARGEST_FAN).astype(np.int64)
    size = inner + 2
    kink = np.repeat(np.arange(len(cuts)), size)
    number = np.arange(len(kink)) - np.repeat(np.cumsum(size) - size, size)
    begins, ends = number == 0, number == size[kink] - 1
    share = np.where(ends, 1.0, number * (1.0 / (inner + 1))[kink])
    normals = _turned(first[kink], last[kink], angle[kink], share[:, None])
    normals[begins], normals[ends] = first, last
    along = unit(kinks.before[kink] * (1 - share)[:, None] + kinks.after[kink] * share[:, None])
    labels = np.where(begins | ends, TOUCHED, BRIDGED)
    nearest = cuts[kink] - (number < (size // 2)[kink])
    place = cuts[kink] - 1 + np.where(ends, 0.75, number * (0.5 / (inner + 1))[kink] + 0.25)
    return (
        np.asarray(place, dtype=np.float64),
        kinks.centers[kink],
        along,
        normals,
        np.asarray(labels),
        np.full(len(kink), -1),
        nearest,
    )


def _turned(first: FloatArray, last: FloatArray, angle: FloatArray, share: FloatArray) -> FloatArray:
    """Directions (N, 3) between two at equal angles (N,); the chord serves where the angle has no digits."""
    straight, angle = angle < 1e-6, angle[:, None]
    with np.errstate(invalid="ignore"):  # an angle of zero, for which the chord serves
        turned = (np.sin((1 - share) * angle) * first + np.sin(share * angle) * last) / np.sin(angle)
    turned[straight] = unit(first[straight] * (1 - share[straight]) + last[straight] * share[straight])
    return np.asarray(turned)


def _span(centers: FloatArray, normals: FloatArray, along: FloatArray, cut: int, usual: float) -> _Part:
    """Points across a gap in which the finger was lifted."""
    width = float(np.linalg.norm(centers[cut] - centers[cut - 1]))
    inner = int(np.clip(np.ceil(width / usual) - 1, 1, LARGEST_FAN))
    share = np.linspace(0.0, 1.0, inner + 2)[1:-1, None]
    mixed = [field[cut - 1] * (1 - share) + field[cut] * share for field in (centers, along, normals)]
    nearest = np.where(share[:, 0] < 0.5, cut - 1, cut)
    place = cut - 1 + share[:, 0]
    return place, mixed[0], unit(mixed[1]), unit(mixed[2]), np.full(inner, EXTRAPOLATED), np.full(inner, -1), nearest


def _without(kinks: Kinks, lifted: IntArray) -> Kinks:
    keep = ~np.isin(kinks.cuts, lifted)
    return Kinks(kinks.cuts[keep], kinks.centers[keep], kinks.before[keep], kinks.after[keep])
