"""Detection: where sweeps passed over something that the base does not explain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapping import BoolArray, DetectionError, FloatArray, IntArray, Trace, length_text
from mapping.base import Base, Cells, LaidSweep, LaidTrace, SweepHeights, fit_base, rows_of
from mapping.detection.candidates import LARGEST_SHARE, Searched, search, without
from mapping.detection.cap_fit import FITTED_BESIDE, Disturbance
from mapping.detection.crossing import STEP_CROSSINGS, Crossing
from mapping.detection.empirical_null import NullScale, effective_noise, limit_along, null_scales
from mapping.detection.filters import (
    FILTER_BINS_PER_HALF_WIDTH,
    Bank,
    build_bank,
    smallest_half_width,
    threshold_for,
)
from mapping.detection.outliers import outliers
from mapping.detection.paper_algorithms import along_chord, curvature_features
from mapping.detection.quiet_noise import (
    RAW_SAMPLES,
    SMALLEST_CREST_SNR,
    Background,
    Stretch,
    background,
    first_noise,
    floored,
    raw_stretches,
)
from mapping.detection.terraces import Terraced, terraced
from mapping.instrument import CONTACT_ROUNDING, ROWS_THAT_SHARE, Levels, Noise, Row, StatedNoise, unshared

# Half-width of the widest disturbance that counts as fine, in tip radii.
LARGEST = 4.0
# Height, in standard deviations of a profile, of the gentlest detail that is no roughness of an unknown base.
ROUGHNESS = 5.0
PROBABILITY = 0.95
# Height, in steps of positions that are rounded, up to which a detail may be the rounding's: half a step to either
# side, and a step and a half of motion between two reports.
UNRESOLVED = 2.5
# Distances between samples that differ by no more than this factor are as good as equal.
ALIKE = 1.15
# Cells of all sweeps that tell whether these share what looks correlated: as many as a base is fitted to
MOST_CELLS = 4000
# A law that says more noise than the sweeps have alone by so many times, of crests of one of so many half-widths from
# this share of a tip radius on, is of a detail. Rows of 12 mm over a groove of 0.3 x 8 mm (ball of 10 mm, noise of
# 3 um): 30 times, and 1.5 where details left a quiet path. What an instrument repeats on every sweep is no detail: axes
# with a play of two standard deviations of a sample, 5 times. Between both
MUCH_MORE, SMALLEST_ASKED, WIDTHS_ASKED = 12.0, 0.1, 8
# A sweep of fewer samples has no level, slope and noise of its own, and half a crest.
SHORTEST_SWEEP_SAMPLES = 8
TOO_SHORT = "are too few to inspect"
# Share of the path that may be taken by what exceeds the threshold without being clear, before the law is doubted:
# simulated in white noise 1.5, 2, 2.5, 3 times as fitted, that share is 0.01, 0.1, 0.23, 0.35; features on a fifth of
# the path would make the median of all of it a third too large.
MOST_WEAK = 0.2
# Rounds in which the scale of the quiet path and what is no quiet path settle: noise ten times as fitted takes six.
NULL_ROUNDS = 8


@dataclass(frozen=True, eq=False)
class Detections:
    """What a trace holds beyond its base.

    Args:
        crossings: one for every place where a sweep passed over something, in the order of the trace.
        noise: of the trace's samples; where its law is not simple, the one under which crests scatter as measured.
        algorithm: number of the paper's algorithm (figure 4) that decided `curvature_feature`.
        detection_limit: smallest height of a sharp crest that a sweep across it detects with `probability`, m.
        probability: 0.95.
        threshold: signal-to-noise ratio above which a crossing is reported.
        inspected_length: length of path inspected, m.
        left_out: sentences naming what could not be inspected, and why.
        inspected_sweeps: (number, length in m) of each sweep that was looked at: of what is long enough for a filter.
        remarks: sentences naming what of the stated promises had to be changed, from what to what, and why.
        unfelt: indices of the trace's samples that no ball on any surface can give; they were left out.
        injected, recovered: crests of the limit's height that were put into the quiet path, and found (see recovery);
            0 where the limit is computed.
        doubt: factor of the threshold, and of any other, for what is not known of the noise.
    """

    crossings: tuple[Crossing, ...]
    noise: Noise
    algorithm: int
    detection_limit: float
    probability: float
    threshold: float
    inspected_length: float
    left_out: tuple[str, ...] = ()
    inspected_sweeps: tuple[tuple[int, float], ...] = ()
    remarks: tuple[str, ...] = ()
    unfelt: tuple[int, ...] = ()
    injected: int = 0
    recovered: int = 0
    doubt: float = 1.0

    @property
    def limit_in_doubt(self) -> bool:
        """True if anything speaks against the limit as computed; sweeps that are too short to be looked at do not."""
        return bool(self.remarks) or not all(said.endswith(TOO_SHORT) for said in self.left_out)

    @classmethod
    def together(cls, parts: Sequence[Detections]) -> Detections:
        """What sweeps detected one by one with the same noise and algorithm hold together; one part at least."""
        usual = max(parts, key=lambda part: part.inspected_length)
        return replace(
            usual,
            crossings=tuple(crossing for part in parts for crossing in part.crossings),
            inspected_length=sum(part.inspected_length for part in parts),
            left_out=tuple(reason for part in parts for reason in part.left_out),
            inspected_sweeps=tuple(each for part in parts for each in part.inspected_sweeps),
            remarks=tuple(dict.fromkeys(remark for part in parts for remark in part.remarks)),
        )


def detect(
    trace: Trace,
    base: Base | None = None,
    *,
    algorithm: int = 3,
    false_alarms_per_metre: float = 0.01,
    noise: Noise | None = None,
    stated: StatedNoise | None = None,
    begin: Noise | None = None,
    largest: float | None = None,
    about: Mapping[int, FloatArray] | None = None,
) -> Detections:
    """Find every crossing of something that the base does not explain.

    The height of the trace over the base's trace is averaged over bins that the smallest visible crest spans
    twelve times; a bank of matched filters, whitened by the noise estimated from the same heights, looks for
    a cap of any size at any place.

    Args:
        trace: one or many sweeps; a LaidTrace keeps what is laid on its base for who comes after.
        base: the known global model; None: fitted to the trace.
        algorithm: number in figure 4 of the paper.
        false_alarms_per_metre: expected number of false crossings per metre of path, 1/m.
        noise: of the samples; None: estimated from the trace.
        stated: what is known of the noise before, say from a data sheet; it guides the estimate over a given mesh.
        begin: of the samples, as whoever felt them measured it on a part of them: over a given mesh the search for the
            quiet path begins there in what is not stated, and nothing else follows from it.
        largest: half-width of the widest disturbance that counts as a fine feature, m; None: four tip radii.
        about: by the number of each sweep the intervals of arclength (M, 2), m, that crossings are wanted of: what does
            not meet them is looked for, but not measured, which takes most of the time; None: of all.

    Raises:
        DetectionError: an unknown algorithm, no samples, or a rate that is not positive.

    Reference: paper section 3 and figure 4; theory sections 3, 4 and 6.
    """
    if algorithm not in (1, 2, 3, 4):
        raise DetectionError(f"unknown algorithm {algorithm!r}; the paper has 1, 2, 3 and 4")
    if not (np.isfinite(false_alarms_per_metre) and false_alarms_per_metre > 0):
        raise DetectionError(f"false alarms per metre must be positive and finite; found {false_alarms_per_metre}")
    if len(trace) == 0:
        raise DetectionError("cannot detect in a trace without samples")
    if base is None:
        base = fit_base(trace)
    laid = LaidTrace.of(trace, base)
    if noise is None and len(trace) <= RAW_SAMPLES:
        laid.feet()  # the noise is read from nearly all of them: whatever else is read follows from that
    asked = _Asked(algorithm, false_alarms_per_metre, noise, stated, begin, largest, about)
    return _detected(trace, laid, asked)


@dataclass(frozen=True, eq=False)
class _Asked:
    """What `detect` is told beside the trace and its base."""

    algorithm: int
    false_alarms_per_metre: float
    noise: Noise | None
    stated: StatedNoise | None
    begin: Noise | None
    largest: float | None
    about: Mapping[int, FloatArray] | None

    def of_sweep(self, number: int) -> FloatArray | None:
        """(M, 2) intervals of arclength that crossings of a sweep are wanted of, m; None: all of it."""
        return None if self.about is None else self.about.get(number, np.zeros((0, 2)))


def _detected(trace: Trace, laid: LaidTrace, asked: _Asked, of_each: Noise | None = None) -> Detections:
    """What `detect` returns; `of_each`: the noise that sweeps have alone, where what they share passed for noise."""
    algorithm, false_alarms_per_metre, noise = asked.algorithm, asked.false_alarms_per_metre, asked.noise
    base, tip = laid.base, trace.tip_radius
    usable, left_out = _usable(laid)
    if not usable:
        return Detections((), noise or Noise(0.0), algorithm, np.inf, PROBABILITY, np.inf, 0.0, left_out)
    raw = float(np.median([_step(sweep) for sweep in usable]))
    stretches = [] if noise else raw_stretches(usable)
    first = of_each or noise
    if first is None and base.known:
        # most of a log may lie on details, and the noise that most samples tell is theirs then
        first = asked.begin or first_noise(stretches, raw, tip)
        first = first if asked.stated is None else asked.stated.instead_of(first)
    first = floored(first or first_noise(stretches, raw, tip, base.known), tip)
    widest = LARGEST * tip if asked.largest is None else asked.largest
    of_sweeps = _profiles(usable, first, tip)
    keep, unfelt = _felt(laid, dict(zip(map(id, usable), of_sweeps, strict=True)))
    if unfelt:
        felt = detect(
            trace.select(keep),
            base,
            algorithm=algorithm,
            false_alarms_per_metre=false_alarms_per_metre,
            noise=noise,
            stated=asked.stated,
            begin=asked.begin,
            largest=asked.largest,
        )
        return _in_all(felt, keep, laid, unfelt)
    over = [terraced(profile, base, tip) for each in of_sweeps for profile in each]
    profiles = [each.profile for each in over]
    stretches = [_over_terraces(stretch, over) for stretch in stretches]
    alone, foretold = profiles, None if of_each is None else _unshared(profiles)
    if foretold is not None:
        alone, stretches = foretold, []
    behind = background(alone, base, noise, stretches, first, tip, widest, asked.stated)
    level = behind.noise
    if noise is None and of_each is None and level.correlated > 0 and len(usable) >= ROWS_THAT_SHARE:
        # what looks correlated may be what the sweeps share; where a quiet path tells as much, all of it tells it best
        apart, widths = _noise_of_each(laid), tip * np.geomspace(SMALLEST_ASKED, LARGEST, WIDTHS_ASKED)
        if apart is not None and (level.cap_sd(widths, raw) > MUCH_MORE * apart.cap_sd(widths, raw)).any():
            return _detected(trace, laid, asked, apart)
    thresholds = {
        spacing: threshold_for(bank, false_alarms_per_metre, behind.uncertainties[spacing])
        for spacing, bank in behind.banks.items()
    }
    found = _searched(profiles, behind, thresholds, tip)
    lengths = {spacing: sum(p.length for p in profiles if p.spacing == spacing) for spacing in thresholds}
    # what is stated of the whole trace holds for the sweeps that make most of it
    usual = max(lengths, key=lambda spacing: lengths[spacing])
    threshold, bank = thresholds[usual], behind.banks[usual]
    found_from = bank.detection_limit(threshold, tip)
    rounding, remarks = UNRESOLVED * trace.resolution, tuple[str, ...]()
    doubt = threshold / threshold_for(bank, false_alarms_per_metre)
    # a noise that is given is the caller's word; one that was fitted is held against the quiet path
    if noise is None and level.white > CONTACT_ROUNDING * tip:
        quiet = found if alone is profiles else _searched(alone, behind, thresholds, tip)
        weighed, nulls = _weighed(alone, list(quiet), behind.banks, level, thresholds, tip)
        if alone is not profiles:
            weighed = _searched(profiles, behind, thresholds, tip, nulls)
        told = [null for p, null in zip(profiles, nulls, strict=True) if p.spacing == usual and null is not None]
        measured = limit_along(bank, told, threshold, tip) if told else found_from
        # where all that is kept must stand out of the rounding of the positions, the law of what is less than that
        # decides nothing; and it is no law: a level path rounds to one value, a steep one to another at each sample
        if measured > rounding:
            as_fitted = all(null.as_fitted for null in told)
            remarks = () if as_fitted else (_raised(measured, found_from, base),)
            # over a base that was fitted to one profile, small features and roughness are the same thing: what
            # speaks against the law is said, and decides nothing (see _stands_out)
            if base.kind != "profile":
                found = weighed
                if not as_fitted:
                    doubt *= told[0].doubt_at(float(np.sqrt(2 * tip * measured)))
                    level = floored(effective_noise(bank, told), tip)
                    level = replace(level, levels=_levels(profiles, nulls, told, measured, tip))
                found_from = measured
    crossings = []
    for one, each in zip(over, found, strict=True):
        disturbances = each.within(asked.of_sweep(each.profile.sweep))
        if base.kind == "profile":
            disturbances = tuple(d for d in disturbances if _stands_out(d, one.profile, level, tip))
        own = [c for d in disturbances for c in _crossings(d, one.profile, base, tip)]
        for edge in one.edges:
            own += [c for c in _crossings(edge.step(level, tip), edge.piece, base, tip) if c.kind in STEP_CROSSINGS]
        crossings += sorted(own, key=lambda c: c.t)
    if narrow := sum(each.unfelt(asked.of_sweep(each.profile.sweep)) for each in found):
        left_out += (f"details that were not felt, for this ball draws nothing so narrow that is so high: {narrow}",)
    crossings, unresolved = _resolved(crossings, trace.resolution)
    left_out += unresolved
    if algorithm != 3:
        crossings = _judged(crossings, usable, algorithm, level)
    limit = max(found_from, rounding)
    lengths_of_each = _inspected(profiles, behind.banks)
    return Detections(
        tuple(crossings),
        level,
        algorithm,
        limit,
        PROBABILITY,
        threshold,
        sum(lengths.values()),
        left_out,
        lengths_of_each,
        remarks,
        doubt=doubt,
    )


def expected_limit(noise: Noise, spacing: float, tip_radius: float, false_alarms_per_metre: float = 0.01) -> float:
    """Height of the smallest sharp crest that `detect` will state as its limit over a known base, m.

    The same bins, filters and threshold, of a noise that is known: of ten explored bodies within 3 % of what the
    analysis of all sweeps found, of one that is mostly a step within 6 %.

    Args:
        noise: of single samples.
        spacing: of the samples along a sweep, m.
        tip_radius: m.
        false_alarms_per_metre: accepted rate of false crossings, 1/m.

    Reference: theory section 6.
    """
    noise = floored(noise, tip_radius)
    narrowest = smallest_half_width(noise, spacing, 1.0, tip_radius, SMALLEST_CREST_SNR)
    samples = max(1, int(narrowest / (FILTER_BINS_PER_HALF_WIDTH * spacing)))
    smallest = smallest_half_width(noise, samples * spacing, samples, tip_radius, SMALLEST_CREST_SNR)
    bank = build_bank(noise, samples * spacing, samples, smallest, max(LARGEST * tip_radius, smallest))
    return bank.detection_limit(threshold_for(bank, false_alarms_per_metre), tip_radius)


def _noise_of_each(laid: LaidTrace) -> Noise | None:
    """Noise of what each sweep reads alone, if its neighbours foretell more of it than noise does (see `unshared`); by
    cells of all sweeps."""
    cells = Cells.of(laid, MOST_CELLS)
    if len(laid) <= RAW_SAMPLES:  # all of so few are laid
        height = np.bincount(cells.cell, laid.feet().height) / np.bincount(cells.cell)
    else:
        height = laid.base.foot(cells.centers, laid.tip_radius).height
    rows = rows_of(cells.centers, height, cells.sweep, len(laid) / len(height))
    rest = unshared(rows)
    if rest is None:
        return None
    each = [Stretch(k, h, rows[k].step * np.arange(float(len(h)))) for k, h in enumerate(rest)]
    found = first_noise(each, rows[0].step, laid.tip_radius)
    return floored(replace(found, white=found.white * float(np.sqrt(rows[0].samples))), laid.tip_radius)


def _unshared(profiles: list[SweepHeights]) -> list[SweepHeights] | None:
    """The profiles without what their sweeps' neighbours foretell of them, if that is more than noise (see `unshared`);
    None of sweeps in pieces, or in bins of several lengths."""
    if len({p.sweep for p in profiles}) < len(profiles) or len({p.spacing for p in profiles}) > 1:
        return None
    rest = unshared([Row(p.centers, p.height, p.spacing, p.samples) for p in profiles])
    return None if rest is None else [replace(p, height=h) for p, h in zip(profiles, rest, strict=True)]


def _searched(
    profiles: list[SweepHeights],
    behind: Background,
    thresholds: dict[float, float],
    tip: float,
    nulls: Sequence[NullScale | None] | None = None,
) -> list[Searched]:
    """Every profile, searched under the noise behind it."""
    each = zip(profiles, nulls or [None] * len(profiles), strict=True)
    return [search(p, behind.banks[p.spacing], behind.noise, thresholds[p.spacing], tip, null) for p, null in each]


def _over_terraces(stretch: Stretch, over: Sequence[Terraced]) -> Stretch:
    """A stretch of samples over the levels that its sweep runs on."""
    height = stretch.height
    for each in (each for each in over if each.profile.sweep == stretch.sweep):
        height = each.lower(stretch.s, height)
    return replace(stretch, height=height)


def _inspected(profiles: list[SweepHeights], banks: dict[float, Bank]) -> tuple[tuple[int, float], ...]:
    """Length of each sweep's profiles that some filter fits into, m."""
    lengths: dict[int, float] = {}
    for profile in profiles:
        fits = banks[profile.spacing].filters[0].half_width <= LARGEST_SHARE * profile.length
        lengths[profile.sweep] = lengths.get(profile.sweep, 0.0) + (profile.length if fits else 0.0)
    return tuple(lengths.items())


def _weighed(
    profiles: list[SweepHeights],
    found: list[Searched],
    banks: dict[float, Bank],
    noise: Noise,
    thresholds: dict[float, float],
    tip: float,
) -> tuple[list[Searched], list[NullScale | None]]:
    """What is found under the scale of the quiet path, and that scale; None where it is the fitted one throughout.

    What is found is left out of the scale, and the scale decides what is found: from the fitted scale upwards, until
    nothing changes. The least scale that explains what it calls quiet is the answer: features never enter it.
    """
    nulls: list[NullScale | None] = [None] * len(profiles)
    for spacing, bank in banks.items():
        numbers = [i for i, profile in enumerate(profiles) if profile.spacing == spacing]
        group, threshold = [profiles[i] for i in numbers], thresholds[spacing]
        # weak features are no reason to doubt the law where the path beside them, most of it, is as fitted
        masks = [found[i].quiet for i in numbers]
        # noise goes up as often as down, features mostly one way: of both the lesser is what noise can have made, and
        # a path that was chosen for what is on it doubts no law
        weak = 2 * min(sum(found[i].weak[0] for i in numbers), sum(found[i].weak[1] for i in numbers))
        if weak > MOST_WEAK * sum(len(mask) for mask in masks):
            masks = [found[i].unclear for i in numbers]
        tails = None
        for _ in range(NULL_ROUNDS):
            heights = [without(p.height, mask, bank) for p, mask in zip(group, masks, strict=True)]
            scales = null_scales(group, heights, masks, bank, threshold, CONTACT_ROUNDING * tip, tails)
            # what is found, but not clear, stays out of the tails: they tell of noise that is nowhere found
            tails = scales[0].tails
            if all(scale.as_fitted for scale in scales):
                for i, scale in zip(numbers, scales, strict=True):
                    if not scale.sampled_alike:
                        nulls[i], found[i] = scale, search(profiles[i], bank, noise, threshold, tip, scale)
                break
            for i, scale in zip(numbers, scales, strict=True):
                nulls[i], found[i] = scale, search(profiles[i], bank, noise, threshold, tip, scale)
            before, masks = masks, [found[i].unclear for i in numbers]
            if all(np.array_equal(one, other) for one, other in zip(before, masks, strict=True)):
                break
    return found, nulls


def _levels(
    profiles: list[SweepHeights], nulls: list[NullScale | None], usual: list[NullScale], limit: float, tip: float
) -> Levels | None:
    """How loud the noise is along the sweeps, as the filter of the smallest crest that is found sees it.

    Over the effective noise, whose variance is the mean of all that the usual scales tell.
    """
    half_width = min(float(np.sqrt(2 * tip * limit)), float(usual[0].widths[-1]))
    k = usual[0].nearest(half_width)
    mean = float(np.sqrt(np.mean([np.mean(scale.level(k) ** 2) for scale in usual])))
    known = [(p, null) for p, null in zip(profiles, nulls, strict=True) if null is not None]
    return Levels.of([(p.sweep, p.t, null.level(null.nearest(half_width)) / mean) for p, null in known])


def _raised(measured: float, fitted: float, base: Base) -> str:
    before, after = length_text(fitted, 2), length_text(measured, 2)
    said = (
        "the noise is not the same everywhere, or of no simple law: where nothing is, the filters' outputs scatter "
        "otherwise than the fitted noise says"
    )
    if base.kind == "profile":
        return f"{said}; one profile cannot tell roughness from small features, and crests below {after} may be either"
    limit = f"is {after} instead of {before}" if after != before else f"stays {after}"
    return f"{said}; crests are weighed by what was measured, and the limit {limit}"


def _felt(laid: LaidTrace, profiles: dict[int, tuple[SweepHeights, ...]]) -> tuple[BoolArray, tuple[str, ...]]:
    """(N,) False for samples of the trace that cannot have been felt, and a sentence that counts them if there are.

    Args:
        laid: the trace.
        profiles: of the sweeps that are long enough, by the sweep's identity: numbers may come twice.
    """
    found = {
        id(sweep): outliers(sweep, profiles[id(sweep)], laid.tip_radius, laid.resolution)
        for sweep in laid.laid_sweeps
        if id(sweep) in profiles
    }
    each = [found[id(s)].keep if id(s) in found else np.ones(len(s.trace), dtype=bool) for s in laid.laid_sweeps]
    keep = np.concatenate(each)
    if keep.all():
        return keep, ()
    runs, stuck = (sum(getattr(one, name) for one in found.values()) for name in ("impossible", "stuck"))
    kinds = [f"{runs} runs that bend sharper than the ball can"] * (runs > 0)
    kinds += [f"{stuck} runs of readings that do not change"] * (stuck > 0)
    return keep, (f"{int((~keep).sum())} samples were not felt and are left out: {', '.join(kinds)}",)


def _in_all(felt: Detections, keep: BoolArray, laid: LaidTrace, reasons: tuple[str, ...]) -> Detections:
    """What was detected in the samples to keep (N,), with the places of crossings among all samples."""
    all_samples, kept = np.arange(len(keep)), np.flatnonzero(keep)
    own: dict[int, IntArray] = {}
    begin = 0
    for sweep in laid.laid_sweeps:
        end = begin + len(sweep.trace)
        own[sweep.number] = all_samples[begin:end][keep[begin:end]] - begin
        begin = end
    crossings = []
    for c in felt.crossings:
        inside = own[c.sweep]
        stop = int(inside[min(c.stop, len(inside)) - 1]) + 1
        crossings.append(replace(c, start=int(inside[min(c.start, len(inside) - 1)]), stop=stop))
    again = tuple(int(kept[i]) for i in felt.unfelt)
    unfelt = tuple(sorted((*np.flatnonzero(~keep).tolist(), *again)))
    return replace(felt, crossings=tuple(crossings), left_out=(*reasons, *felt.left_out), unfelt=unfelt)


def _resolved(crossings: list[Crossing], resolution: float) -> tuple[list[Crossing], tuple[str, ...]]:
    """Without those that the rounding of the positions can make, which no model of noise describes."""
    kept = [c for c in crossings if abs(c.height) > UNRESOLVED * resolution]
    lost = len(crossings) - len(kept)
    if not lost:
        return kept, ()
    low = UNRESOLVED * resolution
    return kept, (f"{lost} details of at most {length_text(low)} may be rounding: the positions come in steps",)


def _usable(laid: LaidTrace) -> tuple[list[LaidSweep], tuple[str, ...]]:
    """The sweeps that are long enough, and a sentence for each that is not."""
    usable, left_out = [], []
    for sweep in laid.laid_sweeps:
        count, s = len(sweep.trace), sweep.arclength
        if count >= SHORTEST_SWEEP_SAMPLES and s[-1] > 0:
            usable.append(sweep)
        else:
            length = s[-1] if len(s) else 0
            left_out.append(f"sweep {sweep.number}: {count} samples over {length_text(length)} {TOO_SHORT}")
    return usable, tuple(left_out)


def _step(sweep: LaidSweep) -> float:
    """Mean distance of a sweep's samples, m."""
    s = sweep.arclength
    return float(s[-1] / (len(s) - 1))


def _profiles(usable: list[LaidSweep], noise: Noise, tip: float) -> list[tuple[SweepHeights, ...]]:
    """Of every sweep, its profiles in bins that the smallest visible crest spans FILTER_BINS_PER_HALF_WIDTH times."""
    spacings = np.empty(len(usable))
    for alike in _alike(np.array([_step(sweep) for sweep in usable])):
        raw = float(np.median([_step(usable[i]) for i in alike]))
        smallest = smallest_half_width(noise, raw, 1.0, tip, SMALLEST_CREST_SNR)
        spacings[alike] = raw * max(1, int(smallest / (FILTER_BINS_PER_HALF_WIDTH * raw)))
    each = zip(usable, spacings.tolist(), strict=True)
    return [sweep.heights(spacing) for sweep, spacing in each]


def _alike(steps: FloatArray) -> list[IntArray]:
    """Indices of the sweeps that were sampled about as densely as each other: filters know one density."""
    order = np.argsort(steps, kind="stable")
    groups, least = [], steps[order[0]]
    begin = 0
    for i, step in enumerate(steps[order]):
        if step > ALIKE * least:
            groups.append(order[begin:i])
            begin, least = i, step
    return [*groups, order[begin:]]


def _stands_out(found: Disturbance, profile: SweepHeights, noise: Noise, tip: float) -> bool:
    """True unless a detail gentler than the tip hides among the samples of a profile whose base was fitted.

    One profile cannot tell roughness from the base's own shape, and its shape is unknown: such a detail must
    be higher than ROUGHNESS standard deviations of the profile at the resolution that the detail needs.
    """
    if abs(found.curvature) > 1 / (2 * tip):
        return True
    block = max(profile.spacing, found.half_width / FILTER_BINS_PER_HALF_WIDTH)
    variance = noise.block_covariances(1, block, profile.samples * block / profile.spacing)[0]
    return bool(abs(found.height) > ROUGHNESS * np.sqrt(variance))


def _judged(crossings: list[Crossing], usable: list[LaidSweep], algorithm: int, noise: Noise) -> list[Crossing]:
    """Crossings whose `curvature_feature` says whether the paper's algorithm reports a feature of their sign there."""
    judged = []
    for sweep in usable:
        part = sweep.trace
        features = curvature_features(part, algorithm, noise)
        for c in (c for c in crossings if c.sweep == sweep.number and part.t[0] <= c.t <= part.t[-1]):
            low, high = sorted(along_chord(part, part.centers[[c.start, min(c.stop, len(part)) - 1]]))
            sign = 1 if c.height > 0 else -1
            reported = any(f.sign == sign and f.start <= high and f.stop >= low for f in features)
            judged.append(replace(c, curvature_feature=reported))
    return judged


def _crossings(found: Disturbance, profile: SweepHeights, base: Base, tip: float) -> list[Crossing]:
    """A crest as one crossing; a plateau as the step up and the step down at its ends, where they were looked at."""
    if found.flat == 0.0:
        kind = "convex" if found.height > 0 else "concave"
        return [_crossing(found, kind, found.place, found.start, found.stop, profile, base, tip)]
    kinds = ("step up", "step down") if found.height > 0 else ("step down", "step up")
    # the ball stands over an edge of the body where its trace leaves the higher level: at the ends of a plateau's flat
    # top, but at the outer ends of the flanks of a dip's flat floor
    rim = found.flat if found.height > 0 else found.half_width
    edges = (found.place - rim, found.place + rim)
    low, high = profile.start + profile.spacing, profile.start + profile.length - 2 * profile.spacing
    beside = FITTED_BESIDE * (found.stop - found.start)
    bounds = ((found.start, found.place), (found.place, found.stop))
    return [
        _crossing(found, kind, edge, *bound, profile, base, tip)
        for kind, edge, bound, outside in zip(
            kinds, edges, bounds, (found.start <= low, found.stop >= high), strict=True
        )
        if not outside and low <= edge <= high and found.start - beside <= edge <= found.stop + beside
    ]


def _crossing(
    found: Disturbance,
    kind: str,
    place: float,
    start: float,
    stop: float,
    profile: SweepHeights,
    base: Base,
    tip: float,
) -> Crossing:
    s = profile.s
    near = max(found.half_width - found.flat, 2 * profile.spacing)
    low, high = np.clip(np.searchsorted(s, [place - near, place + near]), 0, len(s) - 1)
    if high - low < 2:
        low, high = max(0, low - 1), min(len(s) - 1, low + 2)
    # a line through the path near the crest: the noise of single bins would throw the crest off the sweep
    design = np.column_stack([np.ones(high - low + 1), s[low : high + 1] - place])
    line = np.linalg.lstsq(design, profile.centers[low : high + 1], rcond=None)[0]
    foot = base.foot(line[:1], tip)
    normal = foot.normals[0]
    tangent = line[1] - (line[1] @ normal) * normal
    norm = np.linalg.norm(tangent)
    index = np.clip(np.searchsorted(s, [start, stop]), 0, len(s) - 1)
    # definition 1 on the trace (theory section 3): k > 1/r on the body is k_t > 1/(2 r); a dip between two rims
    # is a kink, sharper than any curvature
    sharp = found.curvature > 1 / (2 * tip) if found.height > 0 else found.curvature < -1 / (2 * tip)
    if kind in STEP_CROSSINGS:
        sharp = bool(abs(found.curvature) > 1 / (2 * tip))
    return Crossing(
        sweep=profile.sweep,
        t=float(np.interp(place, s, profile.t)),
        point=foot.points[0],
        normal=normal,
        tangent=tangent / norm if norm > 0 else tangent,
        kind=kind,
        height=found.height,
        height_sd=found.height_sd,
        position_sd=found.place_sd,
        half_width=found.half_width if found.flat == 0 else near,
        trace_curvature=found.curvature,
        snr=found.snr,
        curvature_feature=bool(sharp),
        start=int(profile.first[index[0]]),
        stop=int(profile.first[min(index[1] + 1, len(s))]),
    )
