"""Outline: which stretches of a profile stand clear of its scatter, and are wide, in bins as wide as that asks for."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mapping import FloatArray
from mapping.assembly.free.section import FLANK, Section, flanks
from mapping.base import SHORTEST_LEVEL, SweepHeights
from mapping.instrument import CONTACT_ROUNDING, core_of, neighbour_scatter, span_of

# Widths of a crest of no width of its own, felt at the same share of the height, from which on the trace is the
# section: what is felt is then mostly the detail's own. Below, families know what the ball hides. Over 80 scratches
# and humps 5 to 30 um wide and 0.3 to 3 um high, in white noise or roughness of a fifth to a sixtieth of that (seeds
# 100 to 119), 1.0 to 1.5 are alike: 68 heights and 58 widths inside; at 3, narrow scratches are left to families that
# do not fit them: 57 and 46
WIDER_THAN_CREST = 1.5
# Several sweeps over one detail are judged together, by their median: one may be a sixth less wide. Of a weld bead
# as wide as the ball, whose height varies by an eighth along it, 31 sweeps show 1.42 to 1.58 times a crest.
# It is one line with 1.0 to 1.4, and all other wide lines of the tests are the same
OF_WIDE_LINE = 1.25
# Bins from where a section leaves the base to where it returns, at least, if its noise asks for wider bins than the
# finest. 6 to 8 are alike, of 12 one scratch of 20 is lost
LEAST_BINS = 8
# That height stands clear of what else the profile scatters by so many of that: details are 10 times as high. At 4 some
# faint sections more are lost, and of the 80 above heights 68 and widths 58 inside instead of 74 and 70; 2 is like 2.5
FLANK_SDS = 2.5

# Half of the width that a ball of a radius feels, at heights, of what it bridges, of a greatest height; all in m
HalfWidth = Callable[[float, FloatArray, float], FloatArray]


def of_all_scales(
    piece: SweepHeights,
    tip_radius: float,
    share: float = SHORTEST_LEVEL,
    least: float = WIDER_THAN_CREST,
    *,
    alone: bool = False,
) -> list[Section]:
    """The sections of a piece, up to a share of its length and from `least` times the width of a crest on, each in the
    finest bins in which it stands clear of their scatter.

    A profile that is alone has hollows from `least` times the width on that the ball would feel of one it hangs in: of
    a hollow that several sweeps cross families know the ends.
    """
    longest = share * piece.length
    found = _sections(piece, tip_radius, longest, least, alone)
    piece = piece.coarser()
    while LEAST_BINS * piece.spacing < SHORTEST_LEVEL * piece.length:
        clear = [
            section
            for section in _sections(piece, tip_radius, longest, least, alone)
            if section.end - section.begin >= LEAST_BINS
        ]
        found += [section for section in clear if not any(overlap(section, other) for other in found)]
        piece = piece.coarser()
    return found


def overlap(one: Section, other: Section) -> bool:
    """True of two sections that share a part of the path."""
    (begin, end), (start, stop) = (each.piece.s[[each.begin, each.end]] for each in (one, other))
    return bool(begin < stop and start < end)


def _sections(piece: SweepHeights, tip_radius: float, longest: float, least: float, alone: bool) -> list[Section]:
    """What stands clear of the usual scatter of a profile, and is wide, up to `longest`, m."""
    z, found = piece.height, []
    smallest = max(neighbour_scatter(z), CONTACT_ROUNDING * tip_radius)
    # of a rack two thirds are wide details: their own heights are not what the rest scatters by
    usual = core_of(z, smallest, span_of(z, smallest)).sd
    for sign in (1.0, -1.0):
        out = np.concatenate([[False], sign * z > FLANK_SDS * usual, [False]])
        edges = np.flatnonzero(np.diff(out.astype(int)))
        for begin, end in zip(edges[::2], edges[1::2], strict=True):
            if begin == 0 or end >= len(z):
                continue  # what goes on beyond the profile's end is no detail
            section = outlined(piece, sign, int(begin), int(end), usual, longest)
            if section is None or (times_bridged if alone else times_crest)(section, tip_radius) <= least:
                continue
            half = _half_mouth if alone and sign < 0.0 else _half_crest
            if _widest(*_above_flanks(section), 2.0 * FLANK_SDS * usual, tip_radius, half) > least:
                found.append(section)
    return found


def outlined(piece: SweepHeights, sign: float, begin: int, end: int, usual: float, longest: float) -> Section | None:
    """The section from where it leaves the scatter of the base to where it comes back, monotone on either side; None of
    one that is not clear of it, or longer than `longest`, m."""
    z = sign * piece.height
    high = float(z[begin:end].max())
    if high * FLANK < FLANK_SDS * usual:
        return None
    low = z < usual
    before, after = np.flatnonzero(low[:begin]), np.flatnonzero(low[end:])
    if not len(before) or not len(after):
        return None
    first, last = int(before[-1]), end + int(after[0])
    if (last - first) * piece.spacing > longest:
        return None
    inside = z[first : last + 1]
    above = np.flatnonzero(inside > FLANK * high)
    if (inside[above[0] : above[-1]] < FLANK * high - FLANK_SDS * usual).any():
        return None  # between its flanks it goes down to where they are read: two details
    top = int(np.argmax(np.convolve(inside, np.ones(3) / 3.0, mode="same")))
    if not 0 < top < len(inside) - 1:
        return None  # all within a bin
    from scipy.optimize import isotonic_regression  # takes longer to import than most profiles to outline

    rise = isotonic_regression(inside[: top + 1], increasing=True).x
    fall = isotonic_regression(inside[top:], increasing=False).x
    monotone = np.concatenate([rise[:-1], [max(rise[-1], fall[0])], fall[1:]])
    return Section(piece, sign, first, last, first + top, monotone)


def times_crest(section: Section, tip_radius: float) -> float:
    """How many times as wide it was felt as a crest of its height and no width of its own, crossed at a right angle."""
    high = float(section.monotone.max())
    left, right = flanks(section, FLANK)
    return float((right.place - left.place) / (2.0 * _half_crest(high, FLANK * high, tip_radius)))


def times_bridged(section: Section, tip_radius: float) -> float:
    """How many times as wide it was felt as what the ball bridges: a crest without a width, or, of a hollow, a mouth
    that the ball hangs in, whose bottom and flanks it does not touch."""
    if section.sign > 0.0:
        return times_crest(section, tip_radius)
    deep = float(section.monotone.max())
    hanging = 2.0 * _half_mouth(deep, FLANK * deep, tip_radius)
    left, right = flanks(section, FLANK)
    # means over a bin make the cusp that it hangs in wider by up to that, and not as deep
    return float((right.place - left.place - section.piece.spacing) / hanging)


def _half_crest(high: float, at: float | FloatArray, tip_radius: float) -> FloatArray:
    """Half of the width that a ball feels at heights `at`, m, of a crest of no width of its own, m."""
    drop = np.clip(high - np.asarray(at), 0.0, tip_radius)
    return np.asarray(np.sqrt(drop * (2.0 * tip_radius - drop)))


def _half_mouth(deep: float, at: float | FloatArray, tip_radius: float) -> FloatArray:
    """Half of the width that a ball feels at depths `at`, m, of a mouth between whose rims it hangs so deep, m."""
    least = np.finfo(float).tiny  # in one that is as wide as the ball, or wider, it hangs nowhere
    half = [np.sqrt(fall * (2.0 * tip_radius - fall)) for fall in (min(deep, tip_radius), np.minimum(at, tip_radius))]
    return np.asarray(np.maximum(half[0] - half[1], least))


def _above_flanks(section: Section) -> tuple[FloatArray, FloatArray]:
    """Places along the sweep and heights, upwards, of a section from flank to flank, there at the height that they are
    read at, m."""
    s = section.piece.s[section.begin : section.end + 1]
    z = section.sign * section.piece.height[section.begin : section.end + 1]
    level = FLANK * section.monotone.max()
    first, last = np.flatnonzero(z > level)[[0, -1]]
    ends = [np.interp(level, z[k], s[k]) for k in ([first - 1, first], [last + 1, last])]
    return np.array([ends[0], *s[first : last + 1], ends[1]]), np.array([level, *z[first : last + 1], level])


def _widest(s: FloatArray, z: FloatArray, clear: float, tip_radius: float, half: HalfWidth) -> float:
    """How many times as wide as what the ball bridges the widest is of the details that heights (N,) at places (N,)
    are of.

    Where they come down between two tops by more than is `clear` (m), they are of two details: crests side by side, as
    burrs are, are together as wide as one bar, but between them the ball hides what is there.
    """
    fallen = np.minimum(np.maximum.accumulate(z), np.maximum.accumulate(z[::-1])[::-1]) - z
    deepest = int(np.argmax(fallen))
    if fallen[deepest] > clear:
        # the bottom lies anywhere in its bin
        aside = 0.25 * (s[deepest + 1] - s[deepest - 1])
        before, after = np.append(s[:deepest], s[deepest] - aside), np.append(s[deepest] + aside, s[deepest + 1 :])
        parts = (before, z[: deepest + 1]), (after, z[deepest:])
        return max(_widest(*part, clear, tip_radius, half) for part in parts)
    bridged = float(half(float(z.max()), z[[0, -1]], tip_radius).sum())
    return float(np.ptp(s)) / bridged if bridged > 0.0 else np.inf
