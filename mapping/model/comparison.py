"""Comparison: what changed between two scans of one object, each change with its probability."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mapping import Feature, FloatArray, Interval
from mapping.geometry.mesh import middle
from mapping.model.merging import NORMAL_QUANTILE_95
from mapping.model.object_model import ObjectModel
from mapping.model.registration import Registration, matched, register, separation
from mapping.model.table import probability

CHANGES = ("new", "gone", "grown", "shrunk", "moved")
# Share of an object's size that it may be shifted by between two scans, where nobody says
SHIFT_SHARE = 0.1
# Signal-to-noise ratio from which on half of all crests are detected: the threshold of the matched filter at the rate
# of false alarms that is asked for by default (docs/detection.md)
THRESHOLD_SNR = 4.5
# Chance that a crest is missed however high it is, for example because it was counted with a neighbour
LEAST_MISSED = 1e-3
# What the two groups' grid spans: share of features that changed, changes in sds of the unchanged, and by which factor
# the sds may be too small. A change is larger than three sds of what did not change, else it could not be told.
SHARES = np.linspace(0.01, 0.95, 24)
SIZES_IN_SDS = np.geomspace(3.0, 3000.0, 25)
DOUBTS = np.array([1.0, 1.25, 1.6, 2.0, 2.5, 3.2])


@dataclass(frozen=True)
class Change:
    """One feature that may have changed.

    Args:
        kind: one of CHANGES.
        first, second: ids in the two models, "" where it is not there.
        probability: that it changed so.
        amount: by how much: of height, or of place; of new and gone ones their height, m.
        place: (3,) middle of its axis, in the first model's frame, m.
    """

    kind: str
    first: str
    second: str
    probability: float
    amount: Interval
    place: tuple[float, float, float]

    def record(self) -> dict[str, object]:
        """The change in JSON's types."""
        amount = {"median": self.amount.median, "low": self.amount.low, "high": self.amount.high}
        names = ("kind", "first", "second", "probability")
        return {name: getattr(self, name) for name in names} | {"amount": amount, "place": list(self.place)}


@dataclass(frozen=True, eq=False)
class Comparison:
    """Two scans compared.

    Args:
        registration: of the second on the first.
        changes: all that were weighed, likely or not; the likeliest first.
        unseen: ids of the first scan's features where the second did not look.
        pairs: features that both scans show.
        apart: by how much the surfaces lie farther from each other, where they are nearest, than the frames may be
            shifted, m; 0 if they do not, or features are in both.
    """

    registration: Registration
    changes: tuple[Change, ...]
    unseen: tuple[str, ...]
    pairs: int
    apart: float = 0.0

    def likely(self, least: float) -> tuple[Change, ...]:
        """The changes that are at least so probable."""
        return tuple(change for change in self.changes if change.probability >= least)


def compare_models(first: ObjectModel, second: ObjectModel, most_shift: float | None = None) -> Comparison:
    """What changed from the first scan to the second.

    Heights and places of the pairs are told apart into two groups (Efron, Large-Scale Inference, 2010, chapter 2):
    those that stayed, whose differences are as large as their intervals say or larger by a common factor, and those
    that changed, by an unknown typical amount. Share, amount and factor are averaged over, so that the pairs themselves
    say how far their intervals can be trusted. What has no partner is gone or new by the chance with which the other
    scan would have shown it.

    Args:
        first, second: models of one object.
        most_shift: largest shift between the two frames that is looked for, m; None: a tenth of the object.
    """
    size = max(first.base.surface.size, second.base.surface.size)
    shift = SHIFT_SHARE * size if most_shift is None else most_shift
    motion = register(first.features, second.features, shift)
    moved = [motion.applied(each) for each in second.features]
    pairs = matched(first.features, moved)
    both = [(first.features[i], moved[j]) for i, j in pairs]
    changes = [*_of_height(both), *_of_place(both, first.base.kind == "profile")]
    changes += _alone(first, second, motion, {i for i, _ in pairs}, "gone")
    changes += _alone(second, first, motion, {j for _, j in pairs}, "new")
    unseen = [
        each.id
        for number, each in enumerate(first.features)
        if number not in {i for i, _ in pairs} and not _was_inspected(each, second, motion, back=False)
    ]
    apart = 0.0 if pairs else max(0.0, _nearest(first, second) - shift)
    return Comparison(motion, tuple(sorted(changes, key=lambda c: -c.probability)), tuple(unseen), len(pairs), apart)


def _nearest(first: ObjectModel, second: ObjectModel) -> float:
    """Distance of the two surfaces where a vertex of either is nearest to the other, m."""
    one, other = first.base, second.base
    there, back = other.nearest.query(one.surface.vertices), one.nearest.query(other.surface.vertices)
    return float(min(np.min(there.distance), np.min(back.distance)))


def changed(differences: FloatArray, sds: FloatArray, dimensions: FloatArray) -> FloatArray:
    """(N,) probability of each difference to be of those that changed; see `compare_models`.

    Args:
        differences: (N,) lengths of the differences, m.
        sds: (N,) standard deviations of each component, m.
        dimensions: (N,) number of components.
    """
    if not len(differences):
        return np.zeros(0)
    sds = np.maximum(sds, np.finfo(float).eps * max(float(np.abs(differences).max()), np.finfo(float).tiny ** 0.25))
    unit = float(np.median(sds))
    share, size, doubt = (axis[..., None] for axis in np.meshgrid(SHARES, unit * SIZES_IN_SDS, DOUBTS, indexing="ij"))
    stayed = _log_normal(differences, (doubt * sds) ** 2, dimensions) + np.log1p(-share)
    went = _log_normal(differences, (doubt * sds) ** 2 + (doubt * size) ** 2, dimensions) + np.log(share)
    both = np.logaddexp(stayed, went)
    weight = both.sum(axis=-1) + 2.0 * np.log1p(-share[..., 0])  # Beta(1, 3): most features stay
    weight = np.exp(weight - weight.max())
    return np.asarray((weight[..., None] * np.exp(went - both)).sum(axis=(0, 1, 2)) / weight.sum())


def _log_normal(length: FloatArray, variance: FloatArray, dimensions: FloatArray) -> FloatArray:
    return np.asarray(-0.5 * dimensions * np.log(variance) - 0.5 * length**2 / variance)


def _sd(interval: Interval) -> float:
    return (interval.high - interval.low) / (2.0 * NORMAL_QUANTILE_95)


def _place(feature: Feature) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in middle(feature.axis)[0])
    return x, y, z


def _of_height(pairs: Sequence[tuple[Feature, Feature]]) -> list[Change]:
    signs = np.array([np.sign(a.height.median) or 1.0 for a, _ in pairs])
    growth = signs * np.array([b.height.median - a.height.median for a, b in pairs])
    sds = np.array([float(np.hypot(_sd(a.height), _sd(b.height))) for a, b in pairs])
    known = np.array([not (a.height.censored or b.height.censored) for a, b in pairs], dtype=bool)
    likely = np.zeros(len(pairs))
    if known.any():
        likely[known] = changed(growth[known], sds[known], np.ones(int(known.sum())))
    return [
        Change("grown" if grew > 0 else "shrunk", a.id, b.id, float(p), Interval.normal(grew, sd), _place(a))
        for (a, b), grew, sd, p in zip(pairs, growth, sds, likely, strict=True)
    ]


def _of_place(pairs: Sequence[tuple[Feature, Feature]], on_a_line: bool) -> list[Change]:
    gaps = np.array([float(np.linalg.norm(np.matmul(*separation(a, b)))) for a, b in pairs])
    sds = np.array([float(np.hypot(a.position_sd, b.position_sd)) for a, b in pairs])
    # a point on a surface moves two ways, a line across itself alone, a point of a profile along it alone
    two = [len(a.axis) == len(b.axis) == 1 and not on_a_line for a, b in pairs]
    likely = changed(gaps, sds, 1.0 + np.array(two, dtype=np.float64))
    return [
        Change("moved", a.id, b.id, float(p), Interval.normal(gap, sd), _place(a))
        for (a, b), gap, sd, p in zip(pairs, gaps, sds, likely, strict=True)
    ]


def _alone(own: ObjectModel, other: ObjectModel, motion: Registration, paired: set[int], kind: str) -> list[Change]:
    """Features of one scan that the other does not show: of those that it would have shown, which share changed?"""
    alone = [each for number, each in enumerate(own.features) if number not in paired]
    seen = np.array([1.0 - _missed(each, own, other, motion, kind == "new") for each in alone])
    share = 0.5
    for _ in range(100):  # the share that maximises the likelihood of pairs and lone ones (EM)
        went = share / (share + (1.0 - share) * (1.0 - seen))
        share = (went.sum() + 0.5) / (len(own.features) + 1.0)
    changes = []
    for each, chance in zip(alone, seen, strict=True):
        known = probability(each)
        there = 1.0 if known is None else known
        left = 0.0 if chance == 0.0 else there * share / (share + (1.0 - share) * (1.0 - chance))
        names = ("", each.id) if kind == "new" else (each.id, "")
        place = motion.applied(each) if kind == "new" else each
        changes.append(Change(kind, *names, float(left), each.height, _place(place)))
    return changes


def _missed(feature: Feature, own: ObjectModel, other: ObjectModel, motion: Registration, back: bool) -> float:
    """Chance that the other scan misses a feature that is there; 1 where it did not look."""
    from scipy.special import ndtr

    if not _was_inspected(feature, other, motion, back):
        return 1.0
    limits = [model.provenance.get("detection_limit") for model in (own, other)]
    ratio = float(limits[0]) / float(limits[1]) if limits[0] and limits[1] else 1.0
    return float(max(LEAST_MISSED, ndtr(THRESHOLD_SNR - feature.evidence.snr * ratio)))


def _was_inspected(feature: Feature, other: ObjectModel, motion: Registration, back: bool) -> bool:
    """True if the other scan came near the feature's place."""
    if other.inspected is None:
        return True
    place = np.array([_place(feature)])
    place = motion.moved(place) if back else (place - motion.centre - motion.shift) @ motion.rotation + motion.centre
    near = other.base.nearest.query(place)
    away = float(np.asarray(near.distance)[0])
    if away > max(feature.width.median, 4.0 * feature.position_sd) and other.base.kind == "profile":
        return False
    return bool(np.isfinite(other.inspected[int(np.asarray(near.face)[0])]))
