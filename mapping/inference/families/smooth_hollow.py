"""Smooth hollows: grooves and pits whose walls run out into the base, from a cosine to the paper's bump upside down."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from mapping import FloatArray
from mapping.geometry.templates import smooth_outline
from mapping.inference.curves import laid_beyond, opened
from mapping.inference.families.groove import GrooveShape
from mapping.inference.families.pit import PitShape
from mapping.inference.families.problem import Sizes
from mapping.inference.likelihood import Prior, Uniform

# At -1, a parabola, the walls meet the base in an edge, which the upright family has; of 32 cosine hollows (depths of
# 0.2 to 0.6 mm, mouths of 2.5 to 4.5 mm, ball of 3 mm) the tapers found were -0.58 to -0.22. The widest skirt is the
# paper's bump upside down.
TAPERS = (-0.65, 1.0)


@dataclass(frozen=True, eq=False)
class SmoothGrooveShape(GrooveShape):
    """Smooth grooves: lateral modes, ends, log half width at half depth, log depth, taper (theory section 4.4).

    An end is round: half of a pit with the groove's section.
    """

    @property
    def names(self) -> tuple[str, ...]:
        ends = () if self.chart.closed else ("start", "end")
        return (*self.modes.names, *ends, "log half width", "log depth", "taper")

    @property
    def units(self) -> tuple[str, ...]:
        ends = () if self.chart.closed else ("m", "m")
        return (*self.modes.units, *ends, "ln m", "ln m", "")

    def templates(self, theta: FloatArray) -> FloatArray:
        """(W, n) heights (negative) over the base's trace, m."""
        from mapping.geometry.templates import smooth_line_heights

        first = self.modes.count
        closed = np.tile([-1e300, 1e300], (len(theta), 1))
        ends = (
            closed
            if self.chart.closed
            else opened(self.chart, self.modes, theta[:, : self.modes.count], theta[:, first : first + 2])
        )
        courses = np.ascontiguousarray(theta[:, :first])
        out, section = np.empty((len(theta), len(self.window))), smooth_section(theta)
        smooth_line_heights(*self.places, courses, ends, *section, self.tip_radius, out)
        outline = partial(smooth_outline, *section)
        laid_beyond(self.mouths, out, theta, self.names, self.tip_radius, outline, fades=True)
        return out


@dataclass(frozen=True, eq=False)
class SmoothPitShape(PitShape):
    """Smooth round pits: position (`free` coordinates), log half width at half depth, log depth, taper."""

    @property
    def names(self) -> tuple[str, ...]:
        return (*super().names[:-2], "log half width", "log depth", "taper")

    @property
    def units(self) -> tuple[str, ...]:
        return (*super().units, "")

    def templates(self, theta: FloatArray) -> FloatArray:
        """(W, n) heights (negative) over the base's trace, m."""
        from mapping.geometry.templates import smooth_point_heights

        place = np.zeros((len(theta), 2))
        place[:, : self.free] = theta[:, : self.free]
        out = np.empty((len(theta), len(self.window)))
        smooth_point_heights(*self._places, self.spot.bends, place, *smooth_section(theta), self.tip_radius, out)
        return out


def smooth_section(theta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(W,) heights (negative), half widths at half depth, m, and tapers."""
    return -np.exp(theta[:, -2]), np.exp(theta[:, -3]), np.ascontiguousarray(theta[:, -1])


def smooth_groove_beside(groove: GrooveShape, sizes: Sizes) -> SmoothGrooveShape:
    """The family on an upright groove's window, with its course, its ends, and the priors of both."""
    return SmoothGrooveShape(groove.window, groove.chart, groove.modes, groove.tip_radius, *_about(groove, sizes))


def smooth_pit_beside(pit: PitShape, sizes: Sizes) -> SmoothPitShape:
    """The family on an upright pit's window, about its spot."""
    return SmoothPitShape(pit.window, pit.spot, pit.tip_radius, pit.free, *_about(pit, sizes))


def smooth_beginnings(upright: GrooveShape | PitShape, beginnings: FloatArray, sizes: Sizes) -> FloatArray:
    """Starts from narrow to wide, from what was felt to twice as deep, with an edge and with a skirt.

    Args:
        upright: the upright family.
        beginnings: (B, P) of it: the places of the first are kept, but for the ends of a line, which are round here:
            the bottom ends half a mouth short of the wall.
        sizes: preliminary ones.
    """
    places = beginnings[0, _places_of(upright)]
    if "start" in upright.names:
        first = upright.names.index("start")
        start, end = beginnings[0, first : first + 2]
        half = 0.5 * float(np.exp(beginnings[0, upright.names.index("log width")]))
        places[-2:] = min(start + half, 0.5 * (start + end)), max(end - half, 0.5 * (start + end))
    starts = [
        [*places, np.log(part * sizes.radius), np.log(more * sizes.height), taper]
        for part in (0.25, 0.5, 1.0)
        for more in (1.0, 2.0)
        for taper in (-0.4, 0.3)
    ]
    return np.array(starts)


def _about(upright: GrooveShape | PitShape, sizes: Sizes) -> tuple[tuple[Prior, ...], FloatArray, FloatArray]:
    """Priors, start and step: the places as in the upright family; half of its mouth is as wide as any half width."""
    half = float(np.log(0.5 * sizes.radius))
    depth = upright.priors[-1]
    places = _places_of(upright)
    priors = (*(upright.priors[k] for k in places), Uniform(half - 2.0, half + 2.0), depth, Uniform(*TAPERS))
    start = np.array([*upright.start[places], half, np.log(sizes.height), -0.2])
    step = np.array([*upright.step[places], 0.02, 0.05, 0.05])
    return priors, start, step


def _places_of(upright: GrooveShape | PitShape) -> list[int]:
    """The parameters of an upright family that a smooth one shares: its places, not its mouth and its depth."""
    return [k for k, name in enumerate(upright.names[:-2]) if name != "end rounding"]
