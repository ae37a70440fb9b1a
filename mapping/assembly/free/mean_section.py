"""Mean section: that of several sweeps across one line, which a root of their number less noise is in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mapping import FloatArray
from mapping.assembly.free.free_sections import FreeSection
from mapping.assembly.free.outline import FLANK_SDS, LEAST_BINS, outlined
from mapping.assembly.free.section import CORE, Section
from mapping.assembly.free.sizes import SectionSizes, sizes_of_section
from mapping.base import SweepHeights
from mapping.instrument import MAD_TO_SD, Noise

# What follows was varied over 24 rasters with a V, a ridge, a slot or a bell 8 to 40 um wide (seeds 100 to 105).
#
# Middles are told by noisy flanks: sections are moved onto their mean, which is taken so many times. Heights within
# their intervals are 17 with 1, 20 with 2, 21 with 3 and with 5
ALIGNMENTS = 3
# Sides that rise by this share of the height between two samples are blurred in a mean of sweeps that sample elsewhere:
# its width is by up to a sample's distance too large, and the arc of a ball that rolls over an edge looks like a flank
# further out: of a rectangle of 1 x 0.2 mm under a ball of 2 mm the mean of 20 sweeps makes at least 1.7 mm, each of
# them 1.00. Both are the mean of the sweeps' own. Gentler sides rise by half of this in bins of an eighth of the
# width (LEAST_BINS), walls by all of the height: 0.15 and 0.4 are alike
BLURRED = 0.25
# What lies farther than this share of the width from the middle is beside a mean section: half of it is the section's
# own. 0.55 and 0.7 are alike
SIDES = 0.6
# A round moves a section by this share of its width at most: middles are told far better, and one that matches nowhere
# does not run away. Of eight rasters (slots, scratches, humps, faint scratches) half and twice as much change no size
FARTHEST_MOVE = 0.1


def mean_sizes(group: Sequence[FreeSection], square: FloatArray, tip: float, noise: Noise) -> SectionSizes:
    """The sizes of the mean section of several sweeps, laid square to the line and on each other.

    The extreme of a single section is the noise's too: of n sweeps together it is so by a root of n less. Where their
    mean is no section, those of the one of the median height stand for all.

    Args:
        square: (N,) sines of the angles between the line and the sweeps.
        tip: radius of the fingertip, m.
        noise: of single samples.
    """
    sizes = _of_mean(group, square, tip, noise)
    if sizes is not None:
        return sizes
    usual = sorted(range(len(group)), key=lambda k: group[k].sizes.height)[len(group) // 2]
    return group[usual].sizes.across(float(square[usual]))


def _of_mean(group: Sequence[FreeSection], square: FloatArray, tip: float, noise: Noise) -> SectionSizes | None:
    """The sizes of the mean section; None if it has none."""
    spacing = float(np.median(square * [section.piece.spacing for section in group]))
    reach = float(np.max(square * [section.sizes.width for section in group]))
    u = spacing * np.arange(-np.ceil(reach / spacing), np.ceil(reach / spacing) + 1)
    shifts = np.zeros(len(group))
    for _ in range(ALIGNMENTS):
        heights = [_laid_square(u + by, *each) for by, *each in zip(shifts, group, square, strict=True)]
        known = np.isfinite(heights).all(axis=0)
        if known.sum() < LEAST_BINS:
            return None
        mean = np.mean(heights, axis=0)[known]
        # least squares: a section that is the mean moved by d differs from it by d times its slope
        slope = np.gradient(mean, spacing)
        gaps = (np.array(heights)[:, known] - mean) @ slope / max(float(slope @ slope), np.finfo(float).tiny)
        shifts = shifts - np.clip(gaps, -FARTHEST_MOVE * reach, FARTHEST_MOVE * reach)
    first = group[0].piece
    samples = float(np.median([section.piece.samples for section in group]))
    index, nowhere = np.arange(len(mean) + 1), np.zeros((len(mean), 3))
    start = float(u[known][0])
    piece = SweepHeights(first.sweep, start, spacing, mean, samples, index, np.zeros(len(mean)), nowhere)
    single = noise.scaled(white=max(samples, 1.0) ** -0.5)
    noise = noise.of_passes(len(group)).scaled(white=(max(samples, 1.0) * len(group)) ** -0.5)
    while len(piece.height) >= LEAST_BINS:
        section = _middle_section(piece, group[0].sign, reach, noise.sd)
        if section is not None:
            sizes = sizes_of_section(section, tip, noise)
            if sizes is None or float(np.median([each.sizes.steep for each in group])) < BLURRED:
                return sizes
            own = [_own_sizes(each, float(by), reach, tip, single) for each, by in zip(group, square, strict=True)]
            width, least, most = (float(np.mean([getattr(s, k) for s in own])) for k in ("width", "least", "most"))
            least_sd = float(np.mean([each.least_sd for each in own])) / np.sqrt(len(own))
            doubt = float(np.median([each.foot_doubt for each in own]))
            return replace(sizes, width=width, foot_doubt=doubt, least=least, most=most, least_sd=least_sd)
        piece, noise = piece.coarser(), noise.scaled(white=2.0**-0.5)
    return None


def _own_sizes(section: FreeSection, square: float, reach: float, tip: float, noise: Noise) -> SectionSizes:
    """The sizes of a sweep's own section, laid square to the line: along a sweep at a slant the ball's arcs are drawn
    out as well, and the sizes along it are not as many times too large as the width is."""
    piece = section.piece
    start = square * float(piece.s[0] - section.sizes.middle)
    laid = replace(piece, start=start, spacing=square * piece.spacing)
    found = _middle_section(laid, section.sign, reach, noise.sd)
    sizes = None if found is None else sizes_of_section(found, tip, noise)
    return section.sizes.across(square) if sizes is None else sizes


def _laid_square(u: FloatArray, section: FreeSection, square: float) -> FloatArray:
    """Heights at places u (N,) across a line, m from the section's middle; NaN beyond its piece."""
    piece = section.piece
    return np.interp(u, square * (piece.s - section.sizes.middle), piece.height, left=np.nan, right=np.nan)


def _middle_section(piece: SweepHeights, sign: float, reach: float, sd: float) -> Section | None:
    """The section about the middle of a mean profile, 2 `reach` long; None if it is not clear of the noise (sd, m)."""
    z = sign * piece.height
    beside = np.abs(piece.height[np.abs(piece.s) > SIDES * reach])
    # off zero, too: what is left of a drift is alike on all that lies beside
    usual = max(sd, MAD_TO_SD * float(np.median(beside)) if len(beside) else 0.0, np.finfo(float).tiny)
    out, inner = z > FLANK_SDS * usual, np.flatnonzero(np.abs(piece.s) < CORE * reach)
    if not len(inner) or not out[inner].any():
        return None
    top = int(inner[np.argmax(z[inner])])
    below = np.flatnonzero(~out)
    before, after = below[below < top], below[below > top]
    if not len(before) or not len(after):
        return None
    return outlined(piece, sign, int(before[-1]) + 1, int(after[0]), usual, np.inf)
