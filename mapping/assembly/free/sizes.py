"""Sizes: height and width of a section on the body, what the ball changes being known (theory section 5.4)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mapping import Interval, length_text
from mapping.assembly.free.section import FLANK, WALL, Flank, Section, flanks
from mapping.instrument import Noise

# The flank once more, half as high: where both tell another width the foot is round, and the width as doubtful as
# that. Nearer to the first (three quarters of it) it does not tell: widths 44
NEAR_FOOT = 0.5 * FLANK
# So many places about the extreme as make its standard deviation this share of the height would be enough (0.002:
# heights 84, 0.01: 85); where it is flat over more, up to so many times as many (1: heights 85, 10: 86). Of a V's tip
# a parabola takes 0.2 of what these places fall short of it
EXTREME_SD, EXTREME_WINDOW = 0.005, 4
# Places that a parabola is drawn through: where fewer are nearly as high as the extreme, one over those beside is told
# by the flanks, of a bar of 0.1 mm felt at two places 12 % too high
FEWEST_OF_TOP = 3
# What lies above this share of the height is called the top (or floor); of a parabola that is 0.22 of the width, less
# than the third from which a top counts as flat by the standard. 0.9 and 0.98 are alike
NEARLY_FLAT = 0.95
# Between these shares of the height a flank is asked whether the ball went down on it, or rolled over an edge: then the
# trace between them is an arc of the ball's radius. It is surely none where it bends by less than half as much, in the
# middle between the bow of a straight flank, none, and that of the arc
NEAR_TOP, HALF_AS_BENT = 0.75, 0.5
# A floor, which was touched: that of a parabola is 0.22 of the width, and by the standard it is a third
FLOOR = 1.0 / 3.0


@dataclass(frozen=True, eq=False)
class SectionSizes:
    """What a section measures, m.

    Args:
        height, height_sd: of its extreme over the base (positive), and its standard deviation.
        below: by how much it may go on beyond what was felt, below it or between two samples.
        width, width_sd: on the body, and its standard deviation by noise.
        foot_doubt: by how much the width may be another where the foot is round, or a side steep between two samples.
        top: width of what is nearly as high as the extreme.
        middle: of the width, from the profile's start.
        steep: the largest rise from one bin to the next, as a share of the height.
        least, most: of what stands up, between which its foot is as wide where the ball rolled over an edge and did not
            touch the flank below; else both are the width.
        least_sd: standard deviation of the least, by noise.
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
    least: float
    most: float
    least_sd: float

    def across(self, square: float) -> SectionSizes:
        """The sizes across a line that a sweep crosses at an angle of this sine."""
        sizes = (square * each for each in (self.width, self.top, self.least, self.most))
        return replace(self, **dict(zip(("width", "top", "least", "most"), sizes, strict=True)))

    @property
    def notes(self) -> tuple[str, ...]:
        """What is to be said of the width."""
        if self.most == self.least:
            return ()
        return (
            f"the tip rolled over its edges: it touched a width of {length_text(self.least, 2)}, and the foot may be "
            f"anything up to {length_text(self.most, 2)} wide",
        )

    def height_interval(self, sign: float, sd: float = 0.0) -> Interval:
        """The signed height: what was felt, as far as it may go on, by its own standard deviation or a larger.

        Flanks of a hollow meet somewhere below what was felt; a crest may be as flat as it was felt.
        """
        sd = max(sd, self.height_sd)
        low, deep = (Interval.normal(sign * height, sd) for height in (self.height, self.height + self.below))
        usual = 0.5 * (low.median + deep.median) if sign < 0.0 else low.median
        return Interval(usual, min(low.low, deep.low), max(low.high, deep.high))

    def width_interval(self, sd: float = 0.0) -> Interval:
        """The width by noise (its own, or more), and by its foot; or its bounds."""
        if self.most > self.least:
            low = Interval.normal(self.least, max(sd, self.least_sd)).low
            high = Interval.normal(self.most, max(sd, self.width_sd)).high
            return Interval(self.least, max(low, 0.0), high, censored=True, bounded=True)
        wide = Interval.normal(self.width, float(np.hypot(max(sd, self.width_sd), self.foot_doubt)))
        return replace(wide, low=max(wide.low, 0.0))


def sizes_of_section(section: Section, tip: float, noise: Noise) -> SectionSizes | None:
    """What a section measures, by the noise of its bins; None if its flanks tell no size."""
    height, hidden = _extreme(section, tip, noise.sd)
    width, width_sd, foot_doubt, middle = _width(section, tip, noise)
    least, most, least_sd = _bounds(section, tip, noise, width)
    steep = float(np.abs(np.diff(section.monotone)).max() / section.monotone.max())
    if not np.isfinite([height, width, width_sd, foot_doubt]).all() or width <= 0.0:
        return None
    left, right = flanks(section, NEARLY_FLAT)
    top = right.place - left.place
    hollow = section.sign < 0.0 and top < FLOOR * width
    below = _unfelt_depth(section, tip, height, noise.sd) if hollow else hidden
    return SectionSizes(height, noise.sd, below, width, width_sd, foot_doubt, top, middle, steep, least, most, least_sd)


def _extreme(section: Section, tip: float, sd: float) -> tuple[float, float]:
    """The height (positive): the crest of a parabola about the extreme, over the places that noise (sd, m) asks for;
    and by how much more it may be between two samples, m.

    Of a top that hardly any sample lies on the highest one is known, and how far a ball may rise beside it.
    """
    z = section.sign * section.piece.height[section.begin : section.end + 1]
    high = float(section.monotone.max())
    # the middle of what is nearly as high, not its highest place, which is high by its noise
    top = np.flatnonzero(section.monotone > min(NEARLY_FLAT, 1.0 - 2.0 * sd / high) * high)
    needed = max(1, int((sd / (EXTREME_SD * high)) ** 2))
    half = max(1, min((len(top) - 1) // 2, EXTREME_WINDOW * needed))
    middle = int(top[0] + top[-1]) // 2
    first = max(middle - half, 0)
    around = z[first : middle + half + 1]
    if len(around) < FEWEST_OF_TOP or (section.sign > 0.0 and len(top) < FEWEST_OF_TOP):
        return float(z[top].mean()), _rise_between(section, tip)
    u = np.arange(len(around)) - (middle - first)
    bent = np.polyfit(u, around, 2)
    crest = -0.5 * bent[1] / bent[0] if bent[0] < 0.0 else 0.0
    crest = float(np.clip(crest, u[0], u[-1]))
    return float(np.polyval(bent, crest)), 0.0


def _rise_between(section: Section, tip: float) -> float:
    """By how much the trace of a crest may rise above its highest sample beside that, m: it is bent by the ball's
    radius at most."""
    if section.sign < 0.0:
        return 0.0
    spacing, top = section.piece.spacing, section.top - section.begin
    beside = section.monotone[[top - 1, top + 1]].max() - section.monotone[top]
    # the circle of the ball's radius through the highest sample and the higher one beside it
    chord = float(np.hypot(spacing, beside))
    if chord >= 2.0 * tip:
        return tip
    turn = np.arcsin(0.5 * chord / tip) + np.arctan2(beside, spacing)
    return float(tip * (1.0 - np.cos(turn))) if turn > 0.0 else 0.0


def _width(section: Section, tip: float, noise: Noise) -> tuple[float, float, float, float]:
    """(width on the body, its standard deviation by noise, by how much it may be another, middle), m.

    The flanks are drawn on to the base, without the ball's part; of what stands up a bent one goes on bent. Where both
    shares of the height tell another width by more than their noise does, the foot is round. Where a side is nearly a
    wall, the chord between two samples is no tangent of the circle that the ball rolls on, and its foot is as doubtful
    as the place of a wall is.
    """
    widths, sds, bent, high = [], [], 0.0, float(section.monotone.max())
    for share in (NEAR_FOOT, FLANK):
        sides, above = flanks(section, share, noise), flanks(section, 2.0 * share, noise)
        hidden = [flank.hidden(tip, flank.wall if section.sign < 0.0 else high - flank.wall) for flank in sides]
        begin, end = (sides[k].foot + side * section.sign * hidden[k] for k, side in enumerate((1.0, -1.0)))
        inside = [0.0, 0.0]
        if section.sign > 0.0:
            inside = [_inside(*pair, share * high, tip) for pair in zip(sides, above, strict=True)]
        begin, end, bent = begin + inside[0], end - inside[1], sum(inside)
        widths.append(end - begin)
        sds.append(float(np.linalg.norm([flank.foot_sd for flank in sides])))
    foot_doubt = float(np.sqrt(max((widths[1] - widths[0]) ** 2 - sds[0] ** 2, 0.0)))
    steepest = float(np.abs(np.diff(section.monotone)).max()) / (WALL * high)
    between = min(steepest, 1.0) ** 2 * section.piece.spacing / np.sqrt(6.0)
    return widths[1], sds[1], float(np.linalg.norm([foot_doubt, between, bent])), 0.5 * float(begin + end)


def _inside(low: Flank, above: Flank, felt: float, tip: float) -> float:
    """How far inside the foot of its tangent that of a flank lies which grows steeper below as it does above, m.

    The ball that rests on the base touches a flank r (1 - cos a) above it, and leaves no trace of what is below. The
    square of a parabola's slope is linear in its height: such a one goes on from the lower of two places to the base.
    Straight, or as bent again, it may be as well: that is the doubt of its foot. 0 of a flank that is straight within
    the noise of its feet, and of one that runs out.

    Args:
        low, above: the flank where it is felt at a height over the base, and at twice that.
        felt: that height, m.
        tip: radius, m.
    """
    if not (np.isnan(low.wall) and np.isnan(above.wall)):
        return 0.0
    square = np.tan([low.angle, above.angle]) ** 2
    touched = felt * np.array([1.0, 2.0]) + tip * (1.0 - np.cos([low.angle, above.angle]))
    if square[0] <= square[1] or touched[0] >= touched[1]:
        return 0.0
    slope, at_foot = np.sqrt(square[0] + np.array([0.0, touched[0] * (square[0] - square[1]) / np.ptp(touched)]))
    inside = touched[0] / slope - 2.0 * touched[0] / (slope + at_foot)
    return float(np.sqrt(max(inside**2 - low.foot_sd**2 - above.foot_sd**2, 0.0)))


def _bounds(section: Section, tip: float, noise: Noise, width: float) -> tuple[float, float, float]:
    """Least and largest width of the foot, m, and the standard deviation of the least; both are the width where the
    ball surely went down on the flanks.

    On an edge the ball rolls, and the trace is an arc about it. What is below the edge leaves no trace, as far out as
    the ball's own way to the base. So far down it touches what lies on the chord's perpendicular, at least.
    """
    if section.sign < 0.0:
        return width, width, 0.0
    high, top = float(section.monotone.max()), section.top - section.begin
    s, z = section.piece.s[section.begin : section.end + 1], section.monotone
    bridged, least, most, variance = False, 0.0, 0.0, 0.0
    sides = (-s[: top + 1], z[: top + 1]), (s[top:][::-1], z[top:][::-1])  # from the base up, outwards positive
    for (out, rise), flank in zip(sides, flanks(section, FLANK), strict=True):
        foot = flank.foot if out is sides[1][0] else -flank.foot
        low, middle, near_top = np.interp(np.array([FLANK, 0.5 * (FLANK + NEAR_TOP), NEAR_TOP]) * high, rise, out)
        run, fall = low - near_top, (NEAR_TOP - FLANK) * high
        chord = float(np.hypot(run, fall))
        bowed = (middle - 0.5 * (low + near_top)) * fall / chord
        place_sd = noise.sd * run / fall
        doubt = float(np.sqrt(1.5) * place_sd * fall / chord)
        if np.isnan(flank.wall) and Interval.normal(bowed, doubt).high > HALF_AS_BENT * chord**2 / (8.0 * tip):
            away = np.sqrt(max(tip**2 - 0.25 * chord**2, 1e-6 * tip**2))
            least, most, bridged = least + 0.5 * (low + near_top) - away * fall / chord, most + foot, True
            turned = fall * run * tip**2 / (chord**3 * away)  # of it by one of the chord's run
            variance += place_sd**2 * (0.5 + 2.0 * turned**2)
        else:
            foot -= flank.hidden(tip, high - flank.wall)
            least, most = least + foot, most + foot
    return (max(float(least), 0.0), float(most), float(np.sqrt(variance))) if bridged else (width, width, 0.0)


def _unfelt_depth(section: Section, tip: float, height: float, sd: float) -> float:
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
