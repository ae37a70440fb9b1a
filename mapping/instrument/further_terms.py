"""Further terms: what one Ornstein-Uhlenbeck process leaves correlated, explained by more of them and by tones.

Noise whose power goes with 1/f, that has two lengths, or that hums, is no white noise and one process. Where the
innovations of the simpler law are correlated, terms are added one by one, each where the likelihood gains most, as
long as it gains enough; a term that later ones made needless is dropped.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from mapping import BoolArray, FloatArray
from mapping.instrument.block_likelihood import Blocks, NoiseFit, law_misfit, longest_run, most_likely, whitened
from mapping.instrument.noise import Noise
from mapping.instrument.stated import StatedNoise
from mapping.instrument.term import Term

# Correlated terms at most: four give 1/f within 7.5 % over 2.6 decades.
MOST_TERMS = 4
# Standard deviations of the products of neighbouring innovations, over any number of them, beyond which more terms are
# tried at all; and twice the log-likelihood that the best of them must bring as it is tried, all else as it was. They
# only save time, for what is tried must still bring LEAST_TERM_GAIN. Simulated, 1500 to 8000 blocks in 4 to 24 runs:
# of 3000 logs of white noise, half of them with a process, 20 % exceed 2.0 (9 % 2.5, 3 % 3.0), and of these 7 % gain
# 2.0 as tried (14 % 1.0, 3 % 3.0). Of the 57 in 4000 logs with one process more, of 0.05 to 0.6 of the level, in which
# that brings LEAST_TERM_GAIN, 2.0 lets pass 63 %, of those that bring 20 93 % (2.5 45 %, 3.0 28 %), and a start of 2.0
# lets pass 93 % (1.0 all, 3.0 81 %).
NOT_WHITE, LEAST_START_GAIN = 2.0, 2.0
# Twice the log-likelihood that a term must bring. In 900 simulated logs of white noise, with and without a process, a
# term was tried in four and brought 10, 22, 24 and 30: one needless term in 300.
LEAST_TERM_GAIN = 12.0
# Probability with which the largest of a spectrum's peaks is so high in white noise.
CHANCE_LINE = 1e-3
# Blocks in the shortest wave that is looked for: shorter ones may be the echo of one between two samples. A beam that
# rings at 60 Hz (quality 15, as much as there is white noise) has 3.3 under a tip of 3 mm. As a process it put the
# limit to 3.45 levels, at which 88 % of 180 crests were found; as a tone to 2.14, with 95 %, and 0.8 false candidates a
# metre of 1 asked. At 2.2 hums of 50 Hz, of even size, that have 2.4 under a tip of 5 mm are told as well: of 90
# crests of the limit 82 were found, for all.
SHORTEST_TONE = 3.0
# Factor between the lengths that a new term is tried with, and levels over that of a block's mean.
LENGTH_LADDER, LEVEL_LADDER = 3.0, (0.1, 0.3, 1.0)
# Fewest sums of innovations that tell anything.
FEWEST_SUMS = 12


def with_further_terms(blocks: Sequence[Blocks], fit: NoiseFit, start: Noise, stated: StatedNoise | None) -> NoiseFit:
    """The fit with as many further terms as the blocks speak for.

    Args:
        blocks: what was measured, on one or more scales; the first of them, a share of every sweep, tells the terms:
            all would tell them a little better, at several times the cost of the whole detection.
        fit: of white noise and at most one process.
        start: what was found before, perhaps with further terms: they are tried first.
        stated: what was known before, or None.
    """
    blocks = blocks[:1]
    misfit = law_misfit(blocks, fit.noise)
    if start.further and not _is_white(blocks, fit.noise):
        again, better = most_likely(blocks, start, stated)
        if better + LEAST_TERM_GAIN * len(start.further) < misfit:
            fit, misfit = again, better
    for _ in range(MOST_TERMS):
        if len(fit.noise.terms) == MOST_TERMS or _is_white(blocks, fit.noise):
            break
        tried = list(_proposals(blocks, fit.noise))
        misfits = [law_misfit(blocks, noise) for noise in tried]
        if min(misfits) + LEAST_START_GAIN > law_misfit(blocks, fit.noise):
            break
        more, better = most_likely(blocks, tried[int(np.argmin(misfits))], stated)
        if better + LEAST_TERM_GAIN > misfit:
            break
        fit, misfit = _without_needless(blocks, more, better, stated)
    return fit


def _without_needless(
    blocks: Sequence[Blocks], fit: NoiseFit, misfit: float, stated: StatedNoise | None
) -> tuple[NoiseFit, float]:
    """The fit without a term that brings too little beside the others."""
    terms = fit.noise.terms
    for k in range(len(terms) if len(terms) > 1 else 0):
        fewer = Noise.of_terms(fit.noise.white, (*terms[:k], *terms[k + 1 :]), fit.noise.length)
        less, worse = most_likely(blocks, fewer, stated)
        if worse < misfit + LEAST_TERM_GAIN:
            return less, worse
    return fit, misfit


def _is_white(blocks: Sequence[Blocks], noise: Noise) -> bool:
    """True if the innovations under a noise are not correlated with their neighbours, and hold no tone."""
    for each in blocks:
        innovations, begins = whitened(each, noise)[0], each.steps < 0
        if not _sums_are_white(innovations, begins) or _line(each, innovations) is not None:
            return False
    return True


def _sums_are_white(innovations: FloatArray, begins: BoolArray) -> bool:
    """True if sums of neighbours scatter as those of independent values, whatever the values' own levels.

    Over blocks of 2, 4, 8, ... within each run, the square of the sum less the sum of squares has the expectation 0;
    its own scatter is its measure, so that levels that change do not matter (theory equation 6.18).
    """
    runs = np.split(innovations, np.flatnonzero(begins)[1:])
    size, longest = 2, max((len(run) for run in runs), default=0)
    while size <= longest:
        parts = np.concatenate([run[: len(run) // size * size].reshape(-1, size) for run in runs])
        crossed = parts.sum(axis=1) ** 2 - (parts**2).sum(axis=1)
        if np.count_nonzero(crossed) < FEWEST_SUMS:
            break
        if abs(crossed.sum()) > NOT_WHITE * np.sqrt(crossed @ crossed):
            return False
        size *= 2
    return True


def _line(blocks: Blocks, innovations: FloatArray) -> float | None:
    """Wavelength of a tone in what a noise leaves, m, by the highest peak of the runs' mean spectrum; None if none."""
    from scipy.special import gammaincc

    step = np.abs(blocks.steps)
    usual = float(np.median(step)) if len(step) else 0.0
    begins = np.flatnonzero(blocks.steps < 0)
    runs = [
        run
        for run, of in zip(np.split(innovations, begins[1:]), np.split(step, begins[1:]), strict=True)
        if len(run) >= 4 * SHORTEST_TONE and np.abs(of - usual).max() < 0.05 * usual
    ]
    if not runs or usual == 0.0:
        return None
    size = 2 ** int(np.ceil(np.log2(max(len(run) for run in runs)) + 1))
    power = sum(np.abs(np.fft.rfft(run, size)) ** 2 for run in runs)
    told = float(sum(run @ run for run in runs))
    if told == 0.0:
        return None
    mean = np.asarray(power) / told
    first, last = 2 * size // max(len(run) for run in runs), int(size / SHORTEST_TONE)
    if last <= first:
        return None
    peak = first + int(mean[first:last].argmax())
    # of so many runs, the longest counting most, the mean is a gamma variable of this shape
    shape = told**2 / float(sum((run @ run) ** 2 for run in runs))
    by_chance = (last - first) * float(gammaincc(shape, shape * mean[peak]))
    return size * usual / peak if by_chance < CHANCE_LINE else None


def _proposals(blocks: Sequence[Blocks], noise: Noise) -> Iterator[Noise]:
    """The noise with one term more, of several lengths and levels; or with a tone where one is heard."""
    steps = [np.abs(b.steps) for b in blocks if len(b.steps)]
    shortest = 0.5 * min(float(np.median(each)) for each in steps)
    longest = max(longest_run(b) for b in blocks)
    level = float(np.sqrt(noise.block_covariances(1, 2.0 * shortest, blocks[0].samples)[0]))
    count = 2 + int(np.log(longest / shortest) / np.log(LENGTH_LADDER))
    for length in np.geomspace(shortest, longest, count):
        for share in LEVEL_LADDER:
            yield replace(noise, further=(*noise.further, Term(share * level, float(length))))
    for each in blocks:
        wavelength = _line(each, whitened(each, noise)[0])
        if wavelength is not None:
            for length in (0.1 * longest, longest):
                for share in LEVEL_LADDER:
                    tone = Term(share * level, max(length, wavelength), wavelength)
                    yield replace(noise, further=(*noise.further, tone))
            break
