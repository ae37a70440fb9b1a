"""Free sections: details of a sweep so much wider than a crest under the ball that the trace is their surface.

No family is fitted to them: the trace over the base, monotone on both sides of its extreme, is the section. What the
ball changes is known in closed form. On a flank of slope tan(a) the trace stands off the body by r (1/cos a - 1), and
round the edge of a wall it rolls along a circle; the tangent of the trace, drawn on to the base, therefore meets it
r tan(a/2) beside the body's own edge in either case, exactly (theory section 5.4). At the bottom of a hollow the ball
may touch both flanks and not what is between: its depth is then only bounded.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapping import Details, Feature, FloatArray, Interval, Support
from mapping.base import SHORTEST_LEVEL, LaidSweep, LaidTrace, SweepHeights
from mapping.detection import Crossing, Detections, terraced
from mapping.inference.kinds import kind_made_of
from mapping.instrument import Noise, neighbour_scatter, robust_scale

# What follows was varied over 84 profiles of `explore3d bench profiles` on seeds of their own (100 to 111): right are
# 83 each time; heights 86 of 93 and widths 54 of 59 lie within their intervals where no other count is named.
#
# Bins are no finer than this share of the tip's radius: a wall between two of them is told to 0.1 / sqrt(12) = 0.03
# radii, a thirtieth of what the ball itself takes of a width there
FINEST = 0.1
# Widths of a crest of no width of its own, felt at the same share of the height, from which on the trace is the
# section: what is felt is then mostly the detail's own. Below, families know what the ball hides. Over 80 scratches
# and humps 5 to 30 um wide and 0.3 to 3 um high, in white noise or roughness of a fifth to a sixtieth of that (seeds
# 100 to 119), 1.0 to 1.5 are alike: 68 heights and 58 widths inside; at 3, narrow scratches are left to families that
# do not fit them: 57 and 46
WIDER_THAN_CREST = 1.5
# Bins from where a section leaves the base to where it returns, at least, if its noise asks for wider bins than the
# finest. 6 to 8 are alike, of 12 one scratch of 20 is lost
LEAST_BINS = 8
# Where flanks are read. On a parabola the tangent at a share q meets the base q^2 / 8 of the half-width outside, at a
# quarter 1 %; lower, noise and the foot count for more. At 0.15 widths 51, at 0.4 53
FLANK = 0.25
# That height stands clear of what else the profile scatters by so many of that: details are 10 times as high. At 4 some
# faint sections more are lost, and of the 80 above heights 68 and widths 58 inside instead of 74 and 70; 2 is like 2.5
FLANK_SDS = 2.5
# A tangent is the line through all between these shares of that height: its slope from as much above as below, within
# which a parabola's own changes by an eighth. 0.8 to 1.2: widths 55; 0.4 to 1.6: 53
ABOUT = 0.6, 1.4
# A side that rises by more than half of the height from one sample to the next is a wall: what is left has no part
# that is steeper, and no line through samples tells its place. 0.3 and 0.7 are alike
WALL = 0.5
# The flank once more, half as high: where both tell another width the foot is round, and the width as doubtful as
# that. Nearer to the first (three quarters of it) it does not tell: widths 44
NEAR_FOOT = 0.5 * FLANK
# So many places about the extreme as make its standard deviation this share of the height would be enough (0.002:
# heights 84, 0.01: 85); where it is flat over more, up to so many times as many (1: heights 85, 10: 86). Of a V's tip
# a parabola takes 0.2 of what these places fall short of it
EXTREME_SD, EXTREME_WINDOW = 0.005, 4
# What lies above this share of the height is called the top (or floor); of a parabola that is 0.22 of the width, less
# than the third from which a top counts as flat by the standard. 0.9 and 0.98 are alike
NEARLY_FLAT = 0.95
# A floor, which was touched: that of a parabola is 0.22 of the width, and by the standard it is a third
FLOOR = 1.0 / 3.0
# Middles are told by noisy flanks: sections are moved until they lie on their mean, which is theirs after two rounds
ALIGNMENTS = 3
# Sides that rise by this share of the height between two samples are blurred in a mean of sweeps that sample elsewhere:
# its width is by up to a sample's distance too large
BLURRED = 0.25
# What lies farther than this share of the width from the middle is beside a mean section
SIDES = 0.6
# A section has as many degrees of freedom as splines that would follow it (as in `pooled_residual`)
FREEDOM = 14


@dataclass(frozen=True)
class _Section:
    """One detail of a profile, as indices of its bins: where it leaves the base, where it returns, and its extreme."""

    piece: SweepHeights
    sign: float
    begin: int
    end: int
    top: int
    monotone: FloatArray


@dataclass(frozen=True, eq=False)
class SectionSizes:
    """What a section measures, m.

    Args:
        height, height_sd: of its extreme over the base (positive), and its standard deviation.
        below: by how much it may go on beyond what was felt.
        width, width_sd: on the body, and its standard deviation by noise.
        foot_doubt: by how much the width may be another where the foot is round, or a side steep between two samples.
        top: width of what is nearly as high as the extreme.
        middle: of the width, from the profile's start.
        steep: the largest rise from one bin to the next, as a share of the height.
    """

    height: float
    height_sd: float
    below: float
    width: float
    width_sd: float
    foot_doubt: float
    top: float
    middle: float
    steep: float

    def height_interval(self, sign: float, sd: float = 0.0) -> Interval:
        """The signed height: what was felt, down to what may be below, by its own standard deviation or a larger."""
        sd = max(sd, self.height_sd)
        low, deep = (Interval.normal(sign * height, sd) for height in (self.height, self.height + self.below))
        return Interval(0.5 * (low.median + deep.median), min(low.low, deep.low), max(low.high, deep.high))

    def width_interval(self, sd: float = 0.0) -> Interval:
        """The width by noise (its own, or more), and by its foot."""
        wide = Interval.normal(self.width, float(np.hypot(max(sd, self.width_sd), self.foot_doubt)))
        return replace(wide, low=max(wide.low, 0.0))


@dataclass(frozen=True, eq=False)
class FreeSection:
    """What one sweep shows of a wide detail, measured.

    Args:
        crossing: where its middle is and which way the sweep went there; the signed height as felt.
        sizes: along the sweep.
        piece: heights of the sweep about it, in the finest bins.
        log_odds: for it, on this sweep.
        parts: crossings that are parts of it.
    """

    crossing: Crossing
    sizes: SectionSizes
    piece: SweepHeights
    log_odds: float
    parts: int

    @property
    def sign(self) -> float:
        """+1 of what stands up, -1 of what is hollow."""
        return float(np.sign(self.crossing.height))


def free_sections(detections: Detections, trace: LaidTrace) -> tuple[list[FreeSection], list[Crossing], list[Crossing]]:
    """The wide details on the sweeps over a base that was fitted to them; crossings on one of them; all that are not.

    What is fine on a flank or a floor is too far from the base for a family that stands on it.

    Args:
        detections: of the trace; what they did not notice is no detail, unless the base has levels: a short one may be
            a floor or a plateau.
        trace: laid on its base.

    Reference: theory section 5.4.
    """
    found, rest, upon = list[FreeSection](), list[Crossing](), list[Crossing]()
    by_sweep: dict[int, list[Crossing]] = {}
    for crossing in detections.crossings:
        by_sweep.setdefault(crossing.sweep, []).append(crossing)
    levelled = len(trace.base.levels) > 1  # nothing was noticed of what one of them is the floor or the plateau of
    for sweep in trace.laid_sweeps:
        left = by_sweep.pop(sweep.number, [])
        if left or levelled:
            between = float(np.median(np.diff(sweep.arclength)))
            for over in sweep.heights(max(between, FINEST * trace.tip_radius)):
                own, above = _of_all_scales(over, trace.tip_radius), _on_levels(over, trace)
                above = [each for each in above if not any(_overlap(each, other) for other in own)]
                for number, section in enumerate([*own, *above]):
                    inside = [c for c in left if _overlaps(section, c, sweep.trace.t)]
                    told = inside or (levelled and number < len(own))
                    measured = _measured(section, over, sweep, detections.noise, inside) if told else None
                    if measured is not None:
                        found.append(measured)
                        fine = [c for c in inside if _stands_off(section, c)]
                        upon += [c for c in fine if section.begin < _bin(section.piece, c) < section.end]
                        left = [c for c in left if c not in inside or (c in fine and c not in upon)]
        rest += left
    return found, upon, [*rest, *(c for own in by_sweep.values() for c in own)]


def free_spot(section: FreeSection, algorithm: int) -> Feature:
    """The bump or pit of which one sweep shows a section."""
    crossing, sizes = section.crossing, section.sizes
    return Feature(
        kind=kind_made_of(crossing.kind, line=False).name,
        axis=crossing.point[None],
        normals=crossing.normal[None],
        height=sizes.height_interval(section.sign),
        width=sizes.width_interval(),
        length=Interval(0.0, 0.0, 0.0),
        evidence=Support(crossing.snr, section.parts, (algorithm,), section.log_odds),
        curvature_feature=False,
        position_sd=crossing.position_sd,
        details=Details(top=sizes.top, free_section=True),
    )


def mean_sizes(group: Sequence[FreeSection], square: FloatArray, tip: float, noise: Noise) -> SectionSizes | None:
    """The sizes of the mean section of several sweeps, laid square to the line and on each other; None if it is none.

    The extreme of a single section is the noise's too: of n sweeps together it is so by a root of n less.

    Args:
        square: (N,) sines of the angles between the line and the sweeps.
        tip: radius of the fingertip, m.
        noise: of single samples.
    """
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
        shifts = shifts - np.clip(gaps, -0.1 * reach, 0.1 * reach)
    first = group[0].piece
    samples = float(np.median([section.piece.samples for section in group]))
    index, nowhere = np.arange(len(mean) + 1), np.zeros((len(mean), 3))
    start = float(u[known][0])
    piece = SweepHeights(first.sweep, start, spacing, mean, samples, index, np.zeros(len(mean)), nowhere)
    noise = noise.of_passes(len(group)).scaled(white=(max(samples, 1.0) * len(group)) ** -0.5)
    while len(piece.height) >= LEAST_BINS:
        section = _middle_section(piece, group[0].sign, reach, noise.sd)
        if section is not None:
            sizes = _sizes(section, tip, noise)
            if sizes is None or float(np.median([each.sizes.steep for each in group])) < BLURRED:
                return sizes
            width = float(np.mean(square * [each.sizes.width for each in group]))
            doubt = float(np.median([each.sizes.foot_doubt for each in group]))
            return replace(sizes, width=width, foot_doubt=doubt)
        piece, noise = piece.coarser(), noise.scaled(white=2.0**-0.5)
    return None


def _middle_section(piece: SweepHeights, sign: float, reach: float, sd: float) -> _Section | None:
    """The section about the middle of a mean profile, 2 `reach` long; None if it is not clear of the noise (sd, m)."""
    z = sign * piece.height
    beside = piece.height[np.abs(piece.s) > SIDES * reach]
    usual = max(sd, robust_scale(beside) if len(beside) > 1 else 0.0, np.finfo(float).tiny)
    out, inner = z > FLANK_SDS * usual, np.flatnonzero(np.abs(piece.s) < 0.25 * reach)
    if not len(inner) or not out[inner].any():
        return None
    top = int(inner[np.argmax(z[inner])])
    below = np.flatnonzero(~out)
    before, after = below[below < top], below[below > top]
    if not len(before) or not len(after):
        return None
    return _outlined(piece, sign, int(before[-1]) + 1, int(after[0]), usual, np.inf)


def _laid_square(u: FloatArray, section: FreeSection, square: float) -> FloatArray:
    """Heights at places u (N,) across a line, m from the section's middle; NaN beyond its piece."""
    piece = section.piece
    return np.interp(u, square * (piece.s - section.sizes.middle), piece.height, left=np.nan, right=np.nan)


def _on_levels(piece: SweepHeights, trace: LaidTrace) -> list[_Section]:
    """The sections of a piece over the levels that it runs on; none over a base of one level."""
    over = terraced(piece, trace.base, trace.tip_radius).profile
    return [] if over is piece else _of_all_scales(over, trace.tip_radius)


def _of_all_scales(piece: SweepHeights, tip_radius: float) -> list[_Section]:
    """The sections of a piece, each in the finest bins in which it stands clear of their scatter."""
    found = _sections(piece, tip_radius)
    piece = piece.coarser()
    while LEAST_BINS * piece.spacing < SHORTEST_LEVEL * piece.length:
        clear = [section for section in _sections(piece, tip_radius) if section.end - section.begin >= LEAST_BINS]
        found += [section for section in clear if not any(_overlap(section, other) for other in found)]
        piece = piece.coarser()
    return found


def _overlap(one: _Section, other: _Section) -> bool:
    """True of two sections that share a part of the path."""
    (begin, end), (start, stop) = (each.piece.s[[each.begin, each.end]] for each in (one, other))
    return bool(begin < stop and start < end)


def _sections(piece: SweepHeights, tip_radius: float) -> list[_Section]:
    """What stands clear of the usual scatter of a profile, and is wide."""
    z, found = piece.height, []
    usual = max(robust_scale(z), neighbour_scatter(z), np.finfo(float).tiny)
    for sign in (1.0, -1.0):
        out = np.concatenate([[False], sign * z > FLANK_SDS * usual, [False]])
        edges = np.flatnonzero(np.diff(out.astype(int)))
        for begin, end in zip(edges[::2], edges[1::2], strict=True):
            if begin == 0 or end >= len(z):
                continue  # what goes on beyond the profile's end is no detail
            section = _outlined(piece, sign, int(begin), int(end), usual, SHORTEST_LEVEL * piece.length)
            if section is not None and _is_wide(section, tip_radius):
                found.append(section)
    return found


def _outlined(piece: SweepHeights, sign: float, begin: int, end: int, usual: float, longest: float) -> _Section | None:
    """The section from where it leaves the scatter of the base to where it comes back, monotone on either side; None of
    one that is not clear of it, or longer than `longest`, m."""
    from scipy.optimize import isotonic_regression

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
    top = int(np.argmax(np.convolve(inside, np.ones(3) / 3.0, mode="same")))
    if not 0 < top < len(inside) - 1:
        return None  # all within a bin
    rise = isotonic_regression(inside[: top + 1], increasing=True).x
    fall = isotonic_regression(inside[top:], increasing=False).x
    monotone = np.concatenate([rise[:-1], [max(rise[-1], fall[0])], fall[1:]])
    return _Section(piece, sign, first, last, first + top, monotone)


def _is_wide(section: _Section, tip_radius: float) -> bool:
    """True if a crest of no width of its own would be felt over much less."""
    high = float(section.monotone.max())
    drop = min((1.0 - FLANK) * high, tip_radius)
    crest = 2.0 * np.sqrt(drop * (2.0 * tip_radius - drop))
    left, right = _flanks(section, FLANK)
    return bool(right.place - left.place > WIDER_THAN_CREST * crest)


@dataclass(frozen=True)
class _Flank:
    """A side of a section about a share of its height.

    Args:
        place: where it passes that height, m from the profile's start.
        foot: where its tangent there meets the base, m.
        foot_sd: its standard deviation, m.
        angle: of the tangent over the base, rad.
        wall: mean height of the two samples that a wall lies between, m; NaN of no wall.
    """

    place: float
    foot: float
    foot_sd: float
    angle: float
    wall: float = np.nan

    def hidden(self, tip: float, fall: float) -> float:
        """How far beside the body's own edge the foot lies, m: r tan(a/2) of a tangent.

        Round the edge of a wall the ball rolls on a circle: where it has fallen by so much (m), at most by its radius,
        it is a chord of that circle beside it.
        """
        if np.isnan(self.wall):
            return float(tip * np.tan(0.5 * self.angle))
        return float(np.sqrt(max(fall, 0.0) * (2.0 * tip - fall))) if fall < tip else tip


def _flanks(section: _Section, share: float, noise: Noise | None = None) -> tuple[_Flank, _Flank]:
    """Both sides at a share of the height; without a noise their feet have no standard deviation."""
    s = section.piece.s[section.begin : section.end + 1]
    top = section.top - section.begin
    left = _flank(s[: top + 1], section.monotone[: top + 1], share, noise)
    right = _flank(-s[top:][::-1], section.monotone[top:][::-1], share, noise)
    return left, replace(right, place=-right.place, foot=-right.foot)


def _flank(x: FloatArray, z: FloatArray, share: float, noise: Noise | None) -> _Flank:
    """The line through what lies about a share of the height of a rising side, or the wall between two samples."""
    level, spacing = share * float(z[-1]), float(x[1] - x[0])
    steepest = int(np.diff(z).argmax())
    if z[steepest + 1] - z[steepest] > WALL * z[-1]:
        place = 0.5 * float(x[steepest] + x[steepest + 1])
        middle = 0.5 * float(z[steepest] + z[steepest + 1])
        return _Flank(place, place, spacing / np.sqrt(12.0), 0.5 * np.pi, middle)
    after = max(int(np.argmax(z > level)), 1)
    low, high = ABOUT
    first = min(int(np.argmax(z > low * level)), after - 1)
    last = max(int(np.argmax(z > high * level)), after)
    u, rise = x[first : last + 1] - x[after], z[first : last + 1]
    lines = np.linalg.pinv(np.column_stack([np.ones_like(u), u]))
    offset, slope = lines @ rise
    slope = max(float(slope), np.finfo(float).tiny)
    sd = 0.0
    if noise is not None:
        gradient = np.array([-1.0, offset / slope]) / slope @ lines
        sd = float(np.sqrt(gradient @ noise.covariance(u - u[0]) @ gradient))
    at = float(x[after])
    return _Flank(at + (level - float(offset)) / slope, at - float(offset) / slope, sd, float(np.arctan(slope)))


def _measured(
    section: _Section, over: SweepHeights, sweep: LaidSweep, noise: Noise, inside: list[Crossing]
) -> FreeSection | None:
    """A section of the heights `over` the base, with its sizes; None if its flanks tell none."""
    piece = section.piece
    noise = noise.scaled(white=max(piece.samples, 1.0) ** -0.5)  # of a bin's mean
    place = piece.s[section.begin : section.end + 1]
    snr = float(np.linalg.norm(noise.whiten(section.monotone, place)[0]))
    log_odds = 0.5 * (snr**2 - FREEDOM * np.log1p(snr**2 / FREEDOM)) - np.log(piece.length / np.ptp(place))
    sizes = _sizes(section, sweep.trace.tip_radius, noise)
    if sizes is None or not np.isfinite(log_odds):
        return None
    around = sizes.middle + np.array([-0.5, 0.0, 0.5]) * sizes.width
    before, center, after = (np.array([np.interp(s, piece.s, one) for one in piece.centers.T]) for s in around)
    foot, way = sweep.base.foot(center[None], sweep.trace.tip_radius), after - before
    crossing = Crossing(
        sweep=sweep.number,
        t=float(np.interp(sizes.middle, piece.s, piece.t)),
        point=foot.points[0],
        normal=foot.normals[0],
        tangent=way / max(float(np.linalg.norm(way)), np.finfo(float).tiny),
        kind="convex" if section.sign > 0.0 else "concave",
        height=section.sign * sizes.height,
        height_sd=sizes.height_sd,
        position_sd=0.5 * float(np.hypot(sizes.width_sd, sizes.foot_doubt)),
        half_width=0.5 * sizes.width,
        trace_curvature=0.0,
        snr=snr,
        curvature_feature=False,
        start=int(piece.first[section.begin]),
        stop=int(piece.first[section.end + 1]),
    )
    return FreeSection(crossing, sizes, over, float(log_odds), len(inside))


def _sizes(section: _Section, tip: float, noise: Noise) -> SectionSizes | None:
    """What a section measures, by the noise of its bins; None if its flanks tell no size."""
    height = _extreme(section, noise.sd)
    width, width_sd, foot_doubt, middle = _width(section, tip, noise)
    steep = float(np.abs(np.diff(section.monotone)).max() / section.monotone.max())
    if not np.isfinite([height, width, width_sd, foot_doubt]).all() or width <= 0.0:
        return None
    left, right = _flanks(section, NEARLY_FLAT)
    top = right.place - left.place
    hollow = section.sign < 0.0 and top < FLOOR * width
    below = _unfelt_depth(section, tip, height, noise.sd) if hollow else 0.0
    return SectionSizes(height, noise.sd, below, width, width_sd, foot_doubt, top, middle, steep)


def _extreme(section: _Section, sd: float) -> float:
    """The height (positive): the crest of a parabola about the extreme, over the places that noise (sd, m) asks for."""
    z = section.sign * section.piece.height[section.begin : section.end + 1]
    high = float(section.monotone.max())
    # the middle of what is nearly as high, not its highest place, which is high by its noise
    top = np.flatnonzero(section.monotone > min(NEARLY_FLAT, 1.0 - 2.0 * sd / high) * high)
    needed = max(1, int((sd / (EXTREME_SD * high)) ** 2))
    half = max(1, min(len(top) // 2, EXTREME_WINDOW * needed))
    middle = int(top[0] + top[-1]) // 2
    first = max(middle - half, 0)
    around = z[first : middle + half + 1]
    u = np.arange(len(around)) - (middle - first)
    if len(around) < 3:
        return float(around.max())
    bent = np.polyfit(u, around, 2)
    crest = -0.5 * bent[1] / bent[0] if bent[0] < 0.0 else 0.0
    crest = float(np.clip(crest, u[0], u[-1]))
    return float(np.polyval(bent, crest))


def _width(section: _Section, tip: float, noise: Noise) -> tuple[float, float, float, float]:
    """(width on the body, its standard deviation by noise, by how much it may be another, middle), m.

    The flanks are drawn on to the base, without the ball's part. Where both shares of the height tell another width by
    more than their noise does, the foot is round. Where a side is nearly a wall, the chord between two samples is no
    tangent of the circle that the ball rolls on, and its foot is as doubtful as the place of a wall is.
    """
    widths, sds, high = [], [], float(section.monotone.max())
    for share in (NEAR_FOOT, FLANK):
        left, right = _flanks(section, share, noise)
        begin, end = (
            flank.foot
            + side * section.sign * flank.hidden(tip, flank.wall if section.sign < 0.0 else high - flank.wall)
            for side, flank in ((1.0, left), (-1.0, right))
        )
        widths.append(end - begin)
        sds.append(float(np.hypot(left.foot_sd, right.foot_sd)))
    foot_doubt = float(np.sqrt(max((widths[1] - widths[0]) ** 2 - sds[0] ** 2, 0.0)))
    steepest = float(np.abs(np.diff(section.monotone)).max()) / (WALL * high)
    foot_doubt = float(np.hypot(foot_doubt, min(steepest, 1.0) ** 2 * section.piece.spacing / np.sqrt(6.0)))
    return widths[1], sds[1], foot_doubt, 0.5 * float(begin + end)


def _unfelt_depth(section: _Section, tip: float, height: float, sd: float) -> float:
    """By how much a hollow may go on below what was felt of it: as far as its flanks meet, without the ball, m.

    Between two samples lies the trace's own bottom, and below that the ball touches two flanks and nothing between.
    """
    piece, top = section.piece, section.top
    z = section.sign * piece.height
    count = max(3, int(np.ceil((sd / (EXTREME_SD * height)) ** 2)))
    lines = []
    for side in (slice(max(section.begin, top - count), top), slice(top + 1, min(section.end, top + count) + 1)):
        u, rise = np.arange(side.start, side.stop) - float(top), z[side]
        if len(u) < 3:
            return 0.0
        slope, level = np.polyfit(u, rise, 1)
        error = sd / np.sqrt(len(u) * (len(u) ** 2 - 1) / 12.0)
        if abs(slope) < 2.0 * error:  # a floor
            return 0.0
        lines.append((float(slope), float(level)))
    (up, left), (down, right) = lines
    if not up > 0.0 > down:
        return 0.0
    meeting = left + up * (right - left) / (up - down)
    slope = np.sqrt(-up * down) / piece.spacing
    return float(max(meeting - height, 0.0) + tip * (np.hypot(1.0, slope) - 1.0))


def _overlaps(section: _Section, crossing: Crossing, t: FloatArray) -> bool:
    """True of a crossing whose disturbance, or the path beside that it was compared with, covers part of a section."""
    piece = section.piece
    if not piece.t[0] <= crossing.t <= piece.t[-1]:
        return False
    reach, bins = 2.0 * crossing.half_width / piece.spacing, np.arange(len(piece.t))
    last = min(max(crossing.stop - 1, crossing.start), len(t) - 1)
    begin, end = np.interp([t[crossing.start], t[last]], piece.t, bins)
    at = _bin(piece, crossing)
    return bool(min(begin, at) - reach <= section.end and max(end, at) + reach >= section.begin)


def _bin(piece: SweepHeights, crossing: Crossing) -> float:
    """The place of a crossing among the bins of its piece."""
    return float(np.interp(crossing.t, piece.t, np.arange(len(piece.t))))


def _stands_off(section: _Section, crossing: Crossing) -> bool:
    """True of what a section that is monotone on either side does not hold: a detail on its flank, floor or side."""
    piece = section.piece
    off = piece.height.copy()
    off[section.begin : section.end + 1] -= section.sign * section.monotone
    reach, at = max(1, int(crossing.half_width / piece.spacing)), int(_bin(piece, crossing))
    return bool(np.abs(off[max(at - reach, 0) : at + reach + 1]).max() > 0.5 * abs(crossing.height))
