"""Quiet noise: CFAR's training cells. The noise of the stretches without a feature, and the filters that find these.

The background beside what is tested sets the threshold, and what looks like a target is left out of it, so that the
rate of false alarms stays constant (censored CFAR; Rohling, Radar CFAR thresholding in clutter and multiple target
situations, IEEE Transactions on Aerospace and Electronic Systems 19, 1983; theory section 6.7).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from mapping import BoolArray, FloatArray
from mapping.base import Base, LaidSweep, LaidTrace, SweepHeights
from mapping.detection.candidates import Suspects, suspects
from mapping.detection.filters import Bank, build_bank, false_alarms_over, filter_sd, smallest_half_width
from mapping.instrument import (
    CONTACT_ROUNDING,
    Blocks,
    Noise,
    NoiseFit,
    StatedNoise,
    estimate_noise,
    fit_noise,
    perturbed,
    relative_sd,
)

# Signal-to-noise ratio of the smallest crest looked for, and of what is kept out of the noise's estimate.
SMALLEST_CREST_SNR = 5.0
SUSPECT = 3.5
# Share that noise may have in what is left out of the noise's own estimate in the end: the highest of a log's noise,
# wherever it exceeds SUSPECT, is a tenth of the power of a process on widths of crests (OU noise on 2.6 m: without it
# the root of its density came out 5.6 +- 0.5 % too low in 79 logs, and 8.5 times as many lines as asked for as faint)
FALSE_DISCOVERIES = 0.1
# Standard deviations off a known base that no bin of noise reaches, even where its level is a guess.
UNLIKELY = 10.0
# Samples that the noise is first estimated from, and blocks that it is fitted to.
RAW_SAMPLES = 40_000
NOISE_FIT_BLOCKS = 8000
# Most rounds in which noise and quiet path settle: they end as soon as nothing changes, of most laws after 2 to 5, of
# what a finger explored, most of it on details, after 5 to 9. Where one process is not enough, as many again: a first
# look through one process takes the slow parts of 1/f noise for features, and two fifths of the path for quiet.
QUIET_NOISE_ROUNDS = 12
# Values of a sweep from which on it has a line of its own: the two that it takes are then a sixth of them at most, and
# the scatter that is left 0.91 of what it was
LINE_VALUES = 12
GOLDEN_RATIO = 0.5 * (1.0 + 5.0**0.5)


@dataclass(frozen=True, eq=False)
class Stretch:
    """Heights of some samples of one sweep.

    Args:
        sweep: number of the sweep.
        height: (N,) over the base, m.
        s: (N,) arclengths along the sweep, m.
    """

    sweep: int
    height: FloatArray
    s: FloatArray


@dataclass(frozen=True, eq=False)
class Background:
    """What stands behind every feature.

    Args:
        noise: of single samples.
        banks: filters for it, by the width of the bins (m) of the profiles that they look at.
        uncertainties: relative standard deviation of each bank's noise.
    """

    noise: Noise
    banks: dict[float, Bank]
    uncertainties: dict[float, float]


def raw_stretches(usable: Sequence[LaidSweep]) -> list[Stretch]:
    """A piece of each sweep, together no more than about RAW_SAMPLES."""
    share = max(64, RAW_SAMPLES // len(usable))
    stretches = []
    for number, sweep in enumerate(usable):
        cut = _piece(len(sweep.trace), share, number)
        stretches.append(Stretch(sweep.number, sweep.feet(cut).height, sweep.arclength[cut]))
    return stretches


def smallest_crest(laid: LaidTrace, step: float) -> float:
    """Half-width of the smallest crest that the noise of a trace lets see, m, whatever numbers its sweeps bear.

    Args:
        laid: the trace on its base.
        step: usual distance of its samples, m.
    """
    share = max(64, RAW_SAMPLES // len(laid.laid_sweeps))
    stretches = []
    for number, sweep in enumerate(laid.laid_sweeps):
        height = sweep.feet(_piece(len(sweep.trace), share, number)).height
        # arclengths go by the sweeps' numbers, which may be wrong
        stretches.append(Stretch(sweep.number, height, step * np.arange(float(len(height)))))
    noise = first_noise(stretches, step, laid.tip_radius)
    return smallest_half_width(noise, step, 1.0, laid.tip_radius, SMALLEST_CREST_SNR)


def _piece(count: int, share: int, number: int) -> slice:
    """So many samples of a sweep, elsewhere in each: the middles of all are where what is explored lies.

    The places are as even as a sequence can make them (multiples of the golden ratio), the first in the middle.
    """
    begin = int(max(0, count - share) * ((0.5 + number * GOLDEN_RATIO) % 1.0))
    return slice(begin, begin + share)


def first_noise(stretches: Sequence[Stretch], spacing: float, tip_radius: float, known: bool = True) -> Noise:
    """Noise of the stretches, features included, by robust statistics; spacing in m between samples.

    Args:
        known: whether the base is; over another one each sweep has an offset and a slope of its own.
    """
    height = np.concatenate([s.height if known else without_line(s.s, s.height) for s in stretches])
    if len(height) < 16:
        return floored(Noise(float(np.std(height))), tip_radius)
    places, offset = [], 0.0
    for stretch in stretches:
        places.append(stretch.s - stretch.s[0] + offset)
        offset = places[-1][-1] + 1000 * spacing
    return floored(estimate_noise(height, np.concatenate(places)), tip_radius)


def without_line(s: FloatArray, height: FloatArray) -> FloatArray:
    """Heights (n,) at arclengths s (n,) without the sweep's own offset and slope, which no filter sees over a base that
    is not known: of sweeps that stand off each other they would be noise that is correlated for ever."""
    if len(s) < LINE_VALUES:
        return height
    # medians: details on less than a quarter of it do not move the slope, on less than half of it the offset
    half = len(s) // 2
    rise = float(np.median((height[-half:] - height[:half]) / np.maximum(s[-half:] - s[:half], np.finfo(float).tiny)))
    rest = height - rise * s
    return np.asarray(rest - np.median(rest))


def floored(noise: Noise, tip_radius: float) -> Noise:
    """The noise, but never less than rounding."""
    return replace(noise, white=max(noise.white, CONTACT_ROUNDING * tip_radius))


def background(
    profiles: Sequence[SweepHeights],
    base: Base,
    given: Noise | None,
    stretches: Sequence[Stretch],
    first: Noise,
    tip_radius: float,
    largest: float,
    stated: StatedNoise | None = None,
) -> Background:
    """The noise of what is no feature, and filters for it; each improves the other unless the noise is given.

    Args:
        profiles: of all sweeps.
        base: the global model.
        given: noise of single samples, or None.
        stretches: samples to fit the noise to (none needed if it is given).
        first: a first estimate.
        tip_radius: m.
        largest: half-width of the widest feature, m.
        stated: what was known of the noise before, if it is not given.
    """
    drift = 0 if base.known else 2
    if given is not None:
        banks = _banks(profiles, floored(given, tip_radius), tip_radius, largest, drift)
        return Background(floored(given, tip_radius), banks, dict.fromkeys(banks, 0.0))
    level, fit, banks = first, NoiseFit(first), _banks(profiles, first, tip_radius, largest, drift)
    quiet: list[BoolArray] = []

    @lru_cache(1)
    def suspected(level: Noise) -> list[Suspects]:
        return [suspects(p, banks[p.spacing], level, SUSPECT, tip_radius) for p in profiles]

    def kept(found: Sequence[Suspects], cuts: dict[float, float]) -> list[BoolArray]:
        each = zip(profiles, found, strict=True)
        return [one.quiet(cuts[p.spacing]) & _likely(p, level, drift) for p, one in each]

    # Features that are not taken out yet look like slow noise: further terms are asked for when one process has
    # found them, and with these the quiet path settles once more
    for several in (False, True):
        for turn in range(QUIET_NOISE_ROUNDS):
            before = quiet
            if turn or not several:
                quiet = kept(suspected(level), dict.fromkeys(banks, SUSPECT))
                if before and all(np.array_equal(a, b) for a, b in zip(quiet, before, strict=True)):
                    break
            one = fit if several and turn == 0 else None
            fit = _fit(profiles, quiet, stretches, level, first, base, stated, several, one)
            level = floored(fit.noise, tip_radius)
            banks = _banks(profiles, level, tip_radius, largest, drift)
            if several and not level.further:
                break
    # what a sum of processes leaves of its law is measured later (`null_scales`), the cut with it; of white noise, as
    # many independent parts as samples, the cut takes a fifth of a per cent
    if base.known and level.terms and not level.further:
        for _ in range(QUIET_NOISE_ROUNDS):
            found, before = suspected(level), quiet
            quiet = kept(found, _cuts(profiles, found, banks))
            if all(np.array_equal(a, b) for a, b in zip(quiet, before, strict=True)):
                break
            fit = _fit(profiles, quiet, stretches, level, first, base, stated, False, None)
            level = floored(fit.noise, tip_radius)
            banks = _banks(profiles, level, tip_radius, largest, drift)
    return Background(level, banks, {spacing: _uncertainty(fit, bank, tip_radius) for spacing, bank in banks.items()})


def _cuts(profiles: Sequence[SweepHeights], found: Sequence[Suspects], banks: dict[float, Bank]) -> dict[float, float]:
    """For the profiles of each width of bins the signal-to-noise ratio from which on what is found is no noise.

    It is the least above which noise explains FALSE_DISCOVERIES of what is found (Benjamini and Hochberg 1995);
    infinite if there is none.
    """
    cuts = {}
    for spacing, bank in banks.items():
        own = [(p, one) for p, one in zip(profiles, found, strict=True) if p.spacing == spacing]
        length = sum(p.length for p, one in own if one.whole.any())
        snrs = np.sort([snr for _, one in own for _, _, snr in one.stretches])[::-1]
        noise = length * false_alarms_over(bank, snrs) if len(snrs) else snrs
        surely = np.flatnonzero(noise <= FALSE_DISCOVERIES * np.arange(1, len(snrs) + 1))
        cuts[spacing] = float(snrs[surely[-1]]) if len(surely) else np.inf
    return cuts


def _likely(profile: SweepHeights, noise: Noise, drift: int) -> BoolArray:
    """(n,) False where a bin is too far off a known base for noise: pieces too short for any filter hide much."""
    if drift:
        return np.ones(len(profile.height), dtype=bool)
    sd = np.sqrt(noise.block_covariances(1, profile.spacing, profile.samples)[0])
    return np.asarray(np.abs(profile.height) <= UNLIKELY * sd)


def _banks(
    profiles: Sequence[SweepHeights], noise: Noise, tip_radius: float, largest: float, drift: int
) -> dict[float, Bank]:
    """Filters for the profiles of each width of bins."""
    banks = {}
    for spacing in dict.fromkeys(p.spacing for p in profiles):
        samples = float(np.mean([p.samples for p in profiles if p.spacing == spacing]))
        smallest = smallest_half_width(noise, spacing, samples, tip_radius, SMALLEST_CREST_SNR)
        banks[spacing] = build_bank(noise, spacing, samples, smallest, max(largest, smallest), drift)
    return banks


def _fit(
    profiles: Sequence[SweepHeights],
    quiet: Sequence[BoolArray],
    stretches: Sequence[Stretch],
    start: Noise,
    first: Noise,
    base: Base,
    stated: StatedNoise | None,
    several: bool,
    one: NoiseFit | None,
) -> NoiseFit:
    """Noise of what is quiet, by likelihood over a known base; over an unknown one by what that disturbs less.

    Of several terms if asked for: what it is with `one` process may be known already.
    """
    if not base.known:
        return NoiseFit(_robust(profiles, quiet, first))
    size = max(1, -(-sum(len(stretch.s) for stretch in stretches) // NOISE_FIT_BLOCKS))
    blocks = [_raw_blocks(stretches, profiles, quiet, size)] if stretches else []
    if sum(p.samples * len(p.height) for p in profiles) > 1.1 * sum(len(stretch.s) for stretch in stretches):
        blocks += [_profile_blocks(p, keep) for p, keep in zip(profiles, quiet, strict=True)]
    return fit_noise(blocks, start, stated, several=several, one=one)


def _raw_blocks(
    stretches: Sequence[Stretch], profiles: Sequence[SweepHeights], quiet: Sequence[BoolArray], size: int
) -> Blocks:
    """Means over `size` samples; NaN where a profile is not quiet."""
    values, steps = [], []
    for stretch in stretches:
        whole = len(stretch.s) // size * size
        if whole < 2 * size:
            continue
        value, s = (column[:whole].reshape(-1, size).mean(axis=1) for column in (stretch.height, stretch.s))
        step = np.diff(s, prepend=s[0])
        typical = float(np.median(step[1:]))
        # what arclength adds in rounding would only cost the likelihood its shortcuts; a gap begins another run
        step = np.where(np.abs(step - typical) < 0.2 * typical, typical, np.maximum(step, 0.01 * typical))
        step = np.where(step > 3 * typical, -typical, step)
        step[0] = -typical
        steps.append(step)
        values.append(np.where(_is_quiet(s, stretch.sweep, profiles, quiet), value, np.nan))
    if not values:
        return Blocks(np.zeros(0), np.zeros(0), 1.0)
    return Blocks(np.concatenate(values), np.concatenate(steps), float(size))


def _is_quiet(s: FloatArray, sweep: int, profiles: Sequence[SweepHeights], quiet: Sequence[BoolArray]) -> BoolArray:
    """True where a profile of the sweep covers the arclengths s (N,) and shows nothing there."""
    result = np.zeros(len(s), dtype=bool)
    for profile, keep in zip(profiles, quiet, strict=True):
        if profile.sweep == sweep:
            index = np.floor((s - profile.start) / profile.spacing + 0.5).astype(np.int64)
            inside = (index >= 0) & (index < len(keep))
            result[inside] = keep[index[inside]]
    return result


def _profile_blocks(profile: SweepHeights, keep: BoolArray) -> Blocks:
    steps = np.full(len(keep), profile.spacing)
    steps[0] = -profile.spacing
    counts = np.diff(profile.first)
    read = counts > 0  # bins without samples lie between their neighbours
    return Blocks(np.where(keep & read, profile.height, np.nan), steps, float(1.0 / np.mean(1.0 / counts[read])))


def _uncertainty(fit: NoiseFit, bank: Bank, tip_radius: float) -> float:
    """Relative standard deviation of the narrowest filter's noise; every threshold rests on it.

    Rounding is known: what few samples say of a noise below it is very uncertain, and of no consequence.
    """
    width, spacing, samples = bank.filters[0].half_width, bank.spacing, bank.samples
    laws = [fit.noise, *(perturbed(fit.noise, k, 0.1) for k in range(len(fit.covariance)))]
    own, *others = (filter_sd(width, floored(law, tip_radius), spacing, samples, bank.drift) for law in laws)
    return relative_sd(fit, np.log(np.array(others) / own) / 0.1)


def _robust(profiles: Sequence[SweepHeights], quiet: Sequence[BoolArray], first: Noise) -> Noise:
    """Noise of the profiles' quiet bins by robust statistics; the white level of single samples."""
    heights, places, offset = [], [], 0.0
    for profile, keep in zip(profiles, quiet, strict=True):
        heights.append(without_line(profile.s[keep], profile.height[keep]))
        places.append(profile.s[keep] - profile.s[0] + offset)
        offset += profile.length + 1000 * profile.spacing
    height = np.concatenate(heights)
    if len(height) < 16:
        return first
    estimated = estimate_noise(height, np.concatenate(places))
    white = estimated.white * np.sqrt(float(np.mean([p.samples for p in profiles])))
    # the raw samples are many more than the bins: their level stands unless the bins contradict it
    if first.white > 0 and abs(np.log(max(white, 1e-300) / first.white)) < 4 * np.sqrt(1.4 / len(height)):
        white = first.white
    return replace(estimated, white=white)
