"""Conformity: what a drawing allows of a kind of feature, and with which probability what was found conforms."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from math import inf, isfinite, isnan, nan
from typing import Any

from mapping import Feature, Interval, length_text

# A part conforms, or fails, if that is proved with this probability: the default of ISO 14253-1:2017
PROOF, DISPROOF = 0.95, 0.05
# Nearer to 0 or 1 a probability is not written out: 90 % intervals tell nothing of such tails
LEAST_TOLD = 1e-3
ANY = "any"
TOLERATED_SIZES = ("height", "width", "length")
NORMAL_QUANTILE_95 = 1.6448536
PASS, FAIL, UNDECIDED = "pass", "fail", "undecided"


@dataclass(frozen=True)
class Tolerance:
    """A size of every feature of a kind lies between two limits; hollows are measured downwards, so as positive.

    Args:
        kind: of the features, or ANY.
        size: one of TOLERATED_SIZES.
        limit: it is at most that, m; inf: as large as it may be.
        least: it is at least that, m.
    """

    kind: str
    size: str
    limit: float = inf
    least: float = 0.0

    def text(self) -> str:
        """Such as "height of every ridge: at most 0.5 mm"."""
        parts = [f"at least {length_text(self.least)}"] if self.least > 0 else []
        parts += [f"at most {length_text(self.limit)}"] if isfinite(self.limit) else []
        return f"{self.size} of every {'feature' if self.kind == ANY else self.kind}: {', '.join(parts)}"

    def probability(self, interval: Interval) -> float:
        """That a size lies within the limits; NaN where the data bound it on one side and that decides nothing."""
        if not (interval.high or interval.low):
            return nan  # the feature has no such size: a step has no width
        if interval.median < 0:
            interval = Interval(-interval.median, -interval.high, -interval.low, interval.censored)
        if interval.censored:
            return DISPROOF if interval.low > self.limit else nan
        return _below(interval, self.limit) - (_below(interval, self.least) if self.least > 0 else 0.0)


@dataclass(frozen=True)
class Judgement:
    """What became of one tolerance.

    Args:
        tolerance: what was asked.
        features: (id, probability that it conforms) of every feature that it speaks of; NaN: not known.
        unseen: why features that it speaks of may have been overlooked, "" if not.
    """

    tolerance: Tolerance
    features: tuple[tuple[str, float], ...]
    unseen: str = ""

    @property
    def probability(self) -> float:
        """That all features found conform; NaN where that of one is not known."""
        product = 1.0
        for _, each in self.features:
            product *= each
        return product

    @property
    def verdict(self) -> str:
        """PASS or FAIL if that is proved, else UNDECIDED."""
        if any(each <= DISPROOF for _, each in self.features) or self.probability <= DISPROOF:
            return FAIL
        return PASS if self.probability >= PROOF and not self.unseen else UNDECIDED

    def reason(self) -> str:
        """What the verdict rests on."""
        worst = sorted((each for each in self.features if not each[1] >= PROOF), key=lambda each: (each[1], each[0]))
        parts = [
            f"{name} {'is not known to conform' if isnan(p) else f'conforms with probability {_told(p)}'}"
            for name, p in worst
        ]
        if self.features and not worst and self.probability < PROOF:
            parts = [f"all of them conform with probability {_told(self.probability)}"]
        if not self.features:
            parts = ["none was found"]
        elif not parts:
            parts = [f"{len(self.features)} found, all conform with probability {_told(self.probability)}"]
        return "; ".join([*parts, *([self.unseen] if self.unseen else [])])

    def record(self) -> dict[str, Any]:
        """As JSON values."""
        of = self.tolerance
        return {
            "kind": of.kind,
            "size": of.size,
            "least": of.least,
            "limit": of.limit if isfinite(of.limit) else None,
            "verdict": self.verdict,
            "reason": self.reason(),
            "features": [{"id": name, "probability": None if isnan(p) else p} for name, p in self.features],
        }


def judged(
    features: Sequence[Feature], tolerances: Sequence[Tolerance], detection_limit: float, swept: float
) -> tuple[Judgement, ...]:
    """What becomes of each tolerance.

    A part conforms only if what was not seen cannot break it: the limit of a height must lie above what sweeps see,
    and the surface must have been swept.

    Args:
        features: that were found.
        tolerances: that are asked for.
        detection_limit: height from which on a sharp crest is seen, m.
        swept: share of the surface that was swept.
    """
    found = []
    for each in tolerances:
        sizes = [(f.id, getattr(f, each.size)) for f in features if each.kind in (ANY, f.kind)]
        if each.kind == ANY:  # not of those that have no such size: a step has no width
            sizes = [(name, size) for name, size in sizes if size.high or size.low]
        unseen = []
        if each.size == "height" and not detection_limit <= each.limit:
            unseen.append(f"what is lower than {length_text(detection_limit, 2)} is not seen")
        if swept < 1.0:
            unseen.append(f"{100 * swept:.0f} % of the surface was swept")
        probabilities = tuple((name, each.probability(size)) for name, size in sizes)
        found.append(Judgement(each, probabilities, "; ".join(unseen)))
    return tuple(found)


def overall(verdicts: Collection[str]) -> str:
    """FAIL if one tolerance is broken, PASS if all are kept, else UNDECIDED; "" without any."""
    verdicts = set(verdicts)
    if not verdicts:
        return ""
    return FAIL if FAIL in verdicts else PASS if verdicts == {PASS} else UNDECIDED


def _told(probability: float) -> str:
    """A probability in words."""
    if not LEAST_TOLD <= probability <= 1.0 - LEAST_TOLD:
        return f"below {LEAST_TOLD:g}" if probability < 0.5 else f"above {1.0 - LEAST_TOLD:g}"
    return f"{probability:.3g}"


def _below(interval: Interval, limit: float) -> float:
    """Probability of a value below a limit: half normal on each side of the median, with the interval's quantiles."""
    from scipy.special import ndtr

    away = limit - interval.median
    side = interval.high - interval.median if away > 0 else interval.median - interval.low
    if side <= 0.0 or not isfinite(away):
        return float(away >= 0)
    return float(ndtr(NORMAL_QUANTILE_95 * away / side))
