"""Stretches: where along a profile the heights leave the base, found by a bank of matched filters."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mapping import BoolArray, FloatArray
from mapping.base import SweepHeights
from mapping.detection.cap_fit import PHYSICAL, Disturbance, fit_cap
from mapping.detection.empirical_null import NullScale, sampling, seen, seen_by_each
from mapping.detection.filters import Bank
from mapping.instrument import Noise, running_mean

# A stretch reaches as far as the smoothed height exceeds this share of the crest, or 2.5 standard deviations.
SKIRT_SHARE = 0.03
SKIRT_SDS = 2.5
# A crest beside a higher one counts if the valley between them is deeper than this share of the lower, and than noise
# digs anywhere on one flat top in a thousand. Each top that is cut is a feature too many: ten of them a metre make the
# rate of false alarms that is asked for, 0.01 a metre.
PROMINENCE = 0.2
DUG_BY_NOISE = 1e-3
# What is left beside a disturbance and lower than this share of it belongs to it: no feature is exactly a cap.
SIDE_LOBE = 0.12
# Share of the threshold that the fitted height must reach too: at the ends of a sweep the fit knows less.
MEASURED = 0.5
LARGEST_SHARE = 0.6
# A disturbance weaker than this many thresholds hides no other: its residual is its own side lobes.
HIDING = 1.5
MOST_DISTURBANCE_ROUNDS = 50
# Thresholds above which a stretch is no noise whatever the law. What is weaker is left in the measurement of the
# noise: a law wrong by a factor of two or three makes many of these, and a median hardly sees a few features.
CLEAR = 3.0


@dataclass(frozen=True, eq=False)
class Searched:
    """What a search of one profile came to.

    Args:
        profile, bank, noise, threshold, tip_radius, null: as in `search`.
        stretches: above the threshold: (heights, first bin, past-last bin, crest, signal-to-noise) of each.
    """

    profile: SweepHeights
    bank: Bank
    noise: Noise
    threshold: float
    tip_radius: float
    null: NullScale | None
    stretches: tuple[tuple[FloatArray, int, int, float, float], ...]

    @property
    def quiet(self) -> BoolArray:
        """(n,) False where something exceeds the threshold."""
        quiet = np.ones(len(self.profile.height), dtype=bool)
        for _, begin, end, _, _ in self.stretches:
            quiet[begin:end] = False
        return quiet

    @property
    def unclear(self) -> BoolArray:
        """(n,) False where something is clearly no noise, and in the skirts and side lobes of that."""
        unclear = np.ones(len(self.profile.height), dtype=bool)
        clear = CLEAR * self.threshold
        for _, begin, end, _, snr in sorted(self.stretches, key=lambda each: each[4] < clear):
            if snr >= clear or not unclear[max(0, 2 * begin - end) : 2 * end - begin].all():
                unclear[begin:end] = False
        return unclear

    @property
    def weak(self) -> tuple[int, int]:
        """Bins of what exceeds the threshold upwards and downwards, and is not clear."""
        down = np.zeros(len(self.profile.height), dtype=bool)
        for _, begin, end, crest, _ in self.stretches:
            down[begin:end] = crest < 0
        weak = self.unclear & ~self.quiet
        return int((weak & ~down).sum()), int((weak & down).sum())

    @property
    def disturbances(self) -> tuple[Disturbance, ...]:
        """Above the threshold, the strongest first; what no ball felt is left out."""
        return self.within(None)

    def within(self, about: FloatArray | None) -> tuple[Disturbance, ...]:
        """The same of those alone whose stretch meets one of (M, 2) intervals of arclength, m; None: all of them."""
        return tuple(each for each in self._measured(about) if each.felt)

    def unfelt(self, about: FloatArray | None = None) -> int:
        """How many are such as no ball draws."""
        return sum(not each.felt for each in self._measured(about))

    def _measured(self, about: FloatArray | None) -> list[Disturbance]:
        """All above the threshold, or those that meet one of the intervals: measured when they are asked for, which
        costs most of a search."""
        found = list[Disturbance]()
        for number, (_, low, high, _, _, _) in enumerate(self._crests):
            begin, end = (self.profile.start + self.profile.spacing * place for place in (low, high - 1))
            met = about is None or bool(((about[:, 0] <= end) & (about[:, 1] >= begin)).any())
            if met and (new := self._disturbance(number)) is not None:
                found.append(new)
        return found

    def _disturbance(self, number: int) -> Disturbance | None:
        """What a crest is, if it is certain and no side lobe of one before it."""
        if number not in self._known:
            new = self._fitted(number)
            certain = abs(new.height) >= MEASURED * self.threshold * new.height_sd and new.snr >= self.threshold
            self._known[number] = new if certain and not self._is_side_lobe(number, new) else None
        return self._known[number]

    def _is_side_lobe(self, number: int, new: Disturbance) -> bool:
        """True if a crest before this one explains it: of those alone that reach so far it is asked what they are."""
        profile, drift = self.profile, self.bank.drift > 0
        for before, (_, low, high, _, _, _) in enumerate(self._crests[:number]):
            length = (high - 1 - low) * profile.spacing
            begin = profile.start + low * profile.spacing
            away = max(begin - new.place, new.place - begin - length, 0.0)
            if away < _reach(length, new, drift):
                old = self._disturbance(before)
                if old is not None and _side_lobe(new, old, drift):
                    return True
        return False

    def _fitted(self, number: int) -> Disturbance:
        """What fits a crest best, where the noise is as loud as there."""
        profile, null = self.profile, self.null
        height, low, high, beside, sign, snr = self._crests[number]
        new = fit_cap(height, (low, high), sign, profile, self.noise, self.bank.drift, self.tip_radius, beside)
        place = (new.place - profile.start) / profile.spacing
        if null is not None:
            new = new.at_scale(null.at(new.half_width, place))
        elif self._sampled is not None:
            level = seen(self._sampled, new.half_width / profile.spacing)
            new = new.at_scale(float(np.interp(place, np.arange(len(level)), level)))
        return replace(new, snr=snr) if not any(beside) and new.snr < snr else new

    @cached_property
    def _crests(self) -> list[tuple[FloatArray, int, int, tuple[bool, bool], float, float]]:
        """(heights, first bin, past-last bin, whether others are right before and behind, sign, signal-to-noise of the
        stretch) of each crest of the stretches."""
        return [
            (height, low, high, (low > begin, high < end), float(np.sign(crest)), snr)
            for height, begin, end, crest, snr in self.stretches
            for low, high in _crests(height, begin, end, crest, self.profile, self.noise, self.tip_radius)
        ]

    @cached_property
    def _sampled(self) -> FloatArray | None:
        return sampling(self.profile, self.bank)

    @cached_property
    def _known(self) -> dict[int, Disturbance | None]:
        return {}


def search(
    profile: SweepHeights,
    bank: Bank,
    noise: Noise,
    threshold: float,
    tip_radius: float,
    null: NullScale | None = None,
) -> Searched:
    """Every disturbance above the threshold, and what is left of the profile without them.

    Args:
        profile: heights along one sweep.
        bank: matched filters for its noise and bins.
        noise: of single samples.
        threshold: smallest signal-to-noise ratio.
        tip_radius: m.
        null: how far the outputs scatter where nothing is, against the noise; None: as the noise says.
    """
    stretches = tuple(_stretches(profile, bank, noise, threshold, tip_radius, null))
    return Searched(profile, bank, noise, threshold, tip_radius, null, stretches)


def without(height: FloatArray, quiet: BoolArray, bank: Bank) -> FloatArray:
    """Heights (n,) with every run that is not quiet brought down to its shoulders."""
    if quiet.all():
        return height
    height = height.copy()
    edges = np.flatnonzero(np.diff(np.concatenate([[True], quiet, [True]])))
    for begin, end in edges.reshape(-1, 2):
        shoulders = _shoulders(height, begin, end, bank)
        height[begin:end] = np.interp(np.arange(begin, end), [begin - 1, end], shoulders)
    return height


@dataclass(frozen=True, eq=False)
class Suspects:
    """What of a profile may be no noise.

    Args:
        whole: (n,) True, but of a profile that is too short for any filter False: what it holds is not known.
        stretches: (first bin, past-last bin, signal-to-noise) of each.
    """

    whole: BoolArray
    stretches: tuple[tuple[int, int, float], ...]

    def quiet(self, threshold: float) -> BoolArray:
        """(n,) False where something exceeds the threshold, or nothing is known."""
        quiet = self.whole.copy()
        for begin, end, snr in self.stretches:
            if snr >= threshold:
                quiet[begin:end] = False
        return quiet


def suspects(profile: SweepHeights, bank: Bank, noise: Noise, threshold: float, tip_radius: float) -> Suspects:
    """What of a profile exceeds a threshold; the other arguments as for `search`."""
    short = bank.filters[0].half_width > LARGEST_SHARE * profile.length
    found = _stretches(profile, bank, noise, threshold, tip_radius)
    return Suspects(
        np.full(len(profile.height), not short), tuple((begin, end, snr) for _, begin, end, _, snr in found)
    )


def _stretches(
    profile: SweepHeights, bank: Bank, noise: Noise, threshold: float, tip_radius: float, null: NullScale | None = None
) -> Iterator[tuple[FloatArray, int, int, float, float]]:
    """(heights, first bin, past-last bin, crest, signal-to-noise) of each stretch.

    Each round takes the candidates that nothing stronger overlaps, removes those stretches from the profile that
    are strong enough to hide others, and looks again, until nothing new exceeds the threshold. A filter sees more than
    its own width: what it no longer sees when the stronger ones of its round are removed was their far lobe. One took
    a crest 0.43 mm high under a noise of 10 um for a bump 15 mm away, with a signal-to-noise ratio of 216.
    """
    height = profile.height.copy()
    certainty = _certainties(profile, bank, null)
    weak: list[tuple[int, float]] = []
    told = set[tuple[int, int, bool]]()
    changed = True
    for _ in range(MOST_DISTURBANCE_ROUNDS):
        if changed:
            candidates = _candidates(height, bank, threshold, tip_radius, certainty)
        accepted, changed = _dominant(candidates, weak), False
        if not accepted:
            return
        for snr, place, half_width, crest, k in accepted:
            if changed and snr * bank.seen(height, place, k) / crest < threshold:
                continue
            begin, end = _extent(height, place, half_width, crest, profile, noise, tip_radius)
            # unevenness anywhere along a crest that the sweep ran along reaches as far as that: one stretch
            if (begin, end, crest > 0.0) not in told:
                yield height.copy(), begin, end, crest, snr
            told.add((begin, end, crest > 0.0))
            if snr < HIDING * threshold:
                weak.append((place, half_width))
                continue
            shoulders = _shoulders(height, begin, end, bank)
            changed = True
            told.clear()
            height[begin:end] = np.interp(np.arange(begin, end), [begin - 1, end], shoulders)


def _certainties(profile: SweepHeights, bank: Bank, null: NullScale | None) -> FloatArray | None:
    """(F, n) expected over actual sd of what each filter that fits sees in each bin; None where it is 1 throughout."""
    count = bank.fitting(len(profile.height), _longest(profile.height, bank))
    if null is not None:
        return 1.0 / np.reshape([null.along(k) for k in range(count)], (count, len(profile.height)))
    sampled = sampling(profile, bank)
    return None if sampled is None else 1.0 / seen_by_each(sampled, bank.widths[:count] / bank.spacing)


def _longest(height: FloatArray, bank: Bank) -> float:
    """Half-width of the widest disturbance that is sought in a profile of heights (n,), m."""
    return LARGEST_SHARE * len(height) * bank.spacing


def _candidates(
    height: FloatArray, bank: Bank, threshold: float, tip_radius: float, certainty: FloatArray | None
) -> FloatArray:
    """(P, 5) signal-to-noise, bin, half-width in bins, height, and filter of local maxima over place for every width,
    the strongest first."""
    sharpest = PHYSICAL / (2 * tip_radius)
    snr, place, k, crest = bank.peaks(height, _longest(height, bank), threshold, sharpest, certainty).T
    half_width = (bank.widths / bank.spacing)[k.astype(np.int64)]
    found = np.column_stack([snr, place, half_width, crest, k])
    return np.asarray(found[np.lexsort(found.T[::-1])[::-1]])


def _dominant(candidates: FloatArray, taken: list[tuple[int, float]]) -> list[tuple[float, int, float, float, int]]:
    """Signal-to-noise, bin, half-width in bins, height and filter of the candidates (P, 5), the strongest first.

    Candidates that overlap a stronger one or one of those taken already (bin, half-width) are left out.
    """
    from mapping.detection.filters import dominant

    # one layout whatever their number, and so one compiled kernel
    spans = np.ascontiguousarray(candidates[:, 1:3])
    kept = candidates[dominant(spans, np.array(taken, dtype=np.float64).reshape(-1, 2))]
    return [(snr, int(place), half_width, crest, int(k)) for snr, place, half_width, crest, k in kept.tolist()]


def _extent(
    height: FloatArray,
    place: int,
    half_width: float,
    crest: float,
    profile: SweepHeights,
    noise: Noise,
    tip_radius: float,
) -> tuple[int, int]:
    """First and past-last bin around a place within which the profile stays off the base on one side."""
    size, sd = _smoothing(crest, half_width, profile, noise, tip_radius)
    low, high = max(0, int(place - half_width)), min(len(height), int(place + half_width) + 2)
    smooth = np.sign(crest) * running_mean(height, size)
    off = smooth > max(SKIRT_SHARE * abs(crest), SKIRT_SDS * sd)
    below, above = np.flatnonzero(~off[:low]), np.flatnonzero(~off[high:])
    begin = int(below[-1]) + 1 if len(below) else 0
    end = high + int(above[0]) if len(above) else len(height)
    return begin, end


def _smoothing(
    crest: float, half_width: float, profile: SweepHeights, noise: Noise, tip_radius: float
) -> tuple[int, float]:
    """Half-size in bins of a running mean that keeps every physical structure, and the sd of its output."""
    sharpest = float(np.sqrt(2 * tip_radius * abs(crest)))
    size = int(0.2 * min(sharpest, half_width * profile.spacing) / profile.spacing)
    count = 2 * size + 1
    covariance = noise.block_covariances(1, count * profile.spacing, count * profile.samples)
    return size, float(np.sqrt(covariance[0]))


def _shoulders(height: FloatArray, begin: int, end: int, bank: Bank) -> tuple[float, float]:
    """Levels to join when a stretch is removed: what stands beside it, as far as that tells what lay below.

    Over an unknown base that is all of it; over a known one what the noise beside says of the noise within: the share
    of its mean that its neighbour has in common, none of white noise. The base itself would be a pit in a sweep that
    noise keeps off it for longer than the stretch, and that the next one.
    """
    size = max(2, (end - begin) // 3)
    share = 1.0
    if bank.drift == 0:
        if not bank.noise.terms:  # to spare the medians
            return 0.0, 0.0
        own, next_ = bank.noise.block_covariances(2, size * bank.spacing, size * bank.samples)
        share = float(next_ / own)
    sides = [height[max(0, begin - size) : begin], height[end : end + size]]
    levels = [share * float(np.median(side)) for side in sides if len(side)] or [0.0]
    return levels[0], levels[-1]


def _crests(
    height: FloatArray,
    begin: int,
    end: int,
    crest: float,
    profile: SweepHeights,
    noise: Noise,
    tip_radius: float,
) -> list[tuple[int, int]]:
    """Bounds of the crests of a stretch: split at valleys deep against the noise and the lower crest beside."""
    size, sd = _smoothing(crest, (end - begin) / 2, profile, noise, tip_radius)
    smooth = np.sign(crest) * running_mean(height, size)[begin:end]
    dug = _dug_by_noise(max(2.0, (end - begin) / (2 * size + 1))) * sd
    valleys = []
    top = lowest = 0
    for i in range(1, len(smooth)):
        if smooth[i] < smooth[lowest]:
            lowest = i
        needed = max(PROMINENCE * min(smooth[top], smooth[i]), dug)
        deep = lowest > top and smooth[i] - smooth[lowest] > needed and smooth[top] - smooth[lowest] > needed
        if deep:
            valleys.append(lowest)
        if deep or smooth[i] > smooth[top]:
            top = lowest = i
    bounds = [begin, *(begin + v for v in valleys), end]
    return list(itertools.pairwise(bounds))


def _dug_by_noise(places: float) -> float:
    """Standard deviations by which the lowest of so many independent places lies under the highest, at most.

    A top and a valley may be any two of n places, n^2 / 2 pairs, and their difference scatters by sqrt(2): the long
    top of a plateau needs more than a crest does.
    """
    from scipy.special import ndtri

    return float(-np.sqrt(2.0) * ndtri(DUG_BY_NOISE / (0.5 * places**2)))


def _side_lobe(new: Disturbance, old: Disturbance, drift: bool) -> bool:
    """True for what is left of a stronger disturbance whose shape is not quite a cap."""
    near = abs(new.place - old.place) < _reach(old.stop - old.start, new, drift)
    return near and abs(new.height) < SIDE_LOBE * abs(old.height)


def _reach(length: float, new: Disturbance, drift: bool) -> float:
    """Distance up to which a disturbance so long has side lobes like a new one, m."""
    return length * (1.0 if drift else 0.6) + new.half_width
