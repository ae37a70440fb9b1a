"""ContactRow: one sweep turned from ball centres into contacts, its interference points opened into fans."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from mapping import FloatArray, IntArray
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

    def select(self, index: IntArray) -> ContactRow:
        """The contacts of these indices."""
        return ContactRow(*(getattr(self, item.name)[index] for item in fields(self)))


def contact_row(centers: FloatArray, outward: FloatArray, tip_radius: float, open_kinks: bool = True) -> ContactRow:
    """The contacts of a sweep (N, 3) in the planes spanned by its tangents and `outward` (N, 3).

    At an interference point the ball touches with two normals. The row then holds both contacts and,
    between them, points of the resting ball: the strip below them cannot be reached (theory section 4).
    """
    kinks = find_kinks(centers, outward) if open_kinks else NO_KINKS
    spacing = np.linalg.norm(np.diff(centers, axis=0), axis=1)
    usual = float(np.median(spacing)) if len(spacing) else 0.0
    lifted = np.flatnonzero(spacing > LIFTED * usual) + 1
    kinks = _without(kinks, lifted)
    along = tangents(centers, np.union1d(kinks.cuts, lifted).astype(np.int64))
    count = len(centers)
    own = np.arange(count)
    parts = [(own.astype(float), centers, along, in_plane(along, outward), np.full(count, TOUCHED), own, own)]
    for k in range(len(kinks.cuts)):
        parts.append(_fan(kinks, k, outward, tip_radius, usual))
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


def _fan(kinks: Kinks, k: int, outward: FloatArray, tip_radius: float, usual: float) -> _Part:
    """Both contacts of the ball at a kink, and points of the ball between them."""
    cut = int(kinks.cuts[k])
    first = in_plane(kinks.before[k : k + 1], outward[cut - 1 : cut])[0]
    last = in_plane(kinks.after[k : k + 1], outward[cut : cut + 1])[0]
    angle = 2 * np.arcsin(min(1.0, float(np.linalg.norm(first - last)) / 2))
    inner = int(np.clip(np.ceil(tip_radius * angle / max(usual, 1e-300)) - 1, 1, LARGEST_FAN))
    share = np.linspace(0.0, 1.0, inner + 2)[:, None]
    normals = np.vstack([first, _turned(first, last, angle, share[1:-1]), last])
    labels = np.r_[TOUCHED, np.full(inner, BRIDGED), TOUCHED]
    half = (inner + 2) // 2
    nearest = np.r_[np.full(half, cut - 1), np.full(inner + 2 - half, cut)]
    along = unit(kinks.before[k] * (1 - share) + kinks.after[k] * share)
    place = cut - 1 + np.linspace(0.25, 0.75, inner + 2)
    return (
        place,
        np.repeat(kinks.centers[k : k + 1], inner + 2, 0),
        along,
        normals,
        labels,
        np.full(inner + 2, -1),
        nearest,
    )


def _turned(first: FloatArray, last: FloatArray, angle: float, share: FloatArray) -> FloatArray:
    """Directions between two at equal angles; the chord serves where the angle has no digits."""
    if angle < 1e-6:
        return unit(first * (1 - share) + last * share)
    return np.asarray((np.sin((1 - share) * angle) * first + np.sin(share * angle) * last) / np.sin(angle))


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
