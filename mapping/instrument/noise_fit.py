"""Noise fit: the most likely level and correlation of the noise in block means, and how well they are known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mapping.instrument.block_likelihood import Blocks, NoiseFit, law_misfit, most_likely, white_alone
from mapping.instrument.further_terms import with_further_terms
from mapping.instrument.noise import Noise
from mapping.instrument.stated import StatedNoise

# A correlated part must raise twice the log-likelihood by this much over white noise alone; one that is stated before
# is given up for white noise if that does. A short path hardly tells: of 0.03 mm of white noise and a sixth of that
# correlated over 1 mm, 0.18 m showed nothing in three of four explorations; filters took their noise for a fifth less
# than it is, and noise was looked at four times
LEAST_LIKELIHOOD_GAIN = 8.0
# Longest correlation, in lengths of the whole path, that the path can tell from an offset of the base.
LONGEST = 0.25


def fit_noise(
    blocks: Sequence[Blocks],
    start: Noise,
    stated: StatedNoise | None = None,
    *,
    several: bool = True,
    one: NoiseFit | None = None,
) -> NoiseFit:
    """The most likely noise, from any start within about a decade; the start where none is found.

    White noise alone, or with one Ornstein-Uhlenbeck process; more terms where what that leaves is not white (see
    `further_terms`).

    Args:
        blocks: what was measured, on one or more scales.
        start: a first estimate (see `estimate_noise`).
        stated: what was known before, or None.
        several: False to stop at one process.
        one: what that came to for the same blocks, where it is known.
    """
    count = sum(int(np.isfinite(b.values).sum()) for b in blocks)
    white = white_alone(blocks)
    if count < 32 or white == 0:
        return NoiseFit(start)
    # units near the data's own, by powers of two: logarithms then see the same digits at every scale
    height = float(np.exp2(np.round(np.log2(white))))
    longest = max(float(np.abs(b.steps).max(initial=0.0)) for b in blocks)
    path = float(np.exp2(np.round(np.log2(longest))))
    known = None if one is None else replace(one, noise=one.noise.scaled(1 / height, 1 / path))
    fit = _unit_fit(
        [Blocks(b.values / height, b.steps / path, b.samples) for b in blocks],
        start.scaled(1 / height, 1 / path),
        None if stated is None else stated.scaled(height, path),
        several,
        known,
    )
    noise = fit.noise.scaled(height, path)
    if noise.correlated > 0 and noise.length > LONGEST * sum(float(np.abs(b.steps).sum()) for b in blocks):
        return NoiseFit(start)
    return replace(fit, noise=noise)


def _unit_fit(
    blocks: Sequence[Blocks], start: Noise, stated: StatedNoise | None, several: bool, one: NoiseFit | None
) -> NoiseFit:
    """The fit in units in which levels and steps are about 1."""
    fit = _of_one_process(blocks, start, stated) if one is None else one
    return with_further_terms(blocks, fit, start, stated) if several else fit


def _of_one_process(blocks: Sequence[Blocks], start: Noise, stated: StatedNoise | None) -> NoiseFit:
    """The fit of white noise, and of one process if it gains enough, or was stated and does not lose as much."""
    white = white_alone(blocks)
    expected = stated.noise if stated is not None and stated.noise.correlated > 0 else None
    guess = start if start.correlated > 0 else expected or Noise(start.white or white, 0.1 * white, 10.0)
    fit, misfit = most_likely(blocks, replace(guess, further=()), stated)
    if misfit + (-LEAST_LIKELIHOOD_GAIN if expected else LEAST_LIKELIHOOD_GAIN) <= law_misfit(blocks, Noise(white)):
        return fit
    alone = np.zeros((3, 3))
    alone[0, 0] = 2.0 / sum(int(np.isfinite(b.values).sum()) for b in blocks)
    return NoiseFit(Noise(white, 0.0, guess.length), alone)
