"""Where the finger was lifted: paths through the air, recorded between one contact and the next.

A ball of radius r that slides over anything, walls and brims too, turns about what it touches: in the plane of its
motion its centre bends away from the body on circles of r cos(lean) at least (theory 4.9). A finger that is lifted,
carried on and set down again turns corners that no such circle fits under. From the foot before such a corner to the
foot behind it nothing was felt. At an end of the recording there is no corner: there a rise is of the air that is too
steep for anything but a wall.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from mapping import BoolArray, FloatArray, Trace, length_text
from mapping.base import LaidTrace, fit_base
from mapping.detection import LONGEST_RUN, SHORTEST_SWEEP_SAMPLES
from mapping.instrument import FEATURE_RESIDUAL_SDS, robust_sd

# Radius of the circle, in tip radii: of a ball that leans by 60 degrees to the side. Of 48 sections that a ball felt
# (steps, blades, bars, grooves, Vs, domes, cones, teeth, 0.6 to 4 r high) none turns too sharply for 0.35 to 0.9, and
# corners of a finger in the air do up to a radius of 0.25, 0.35, 0.55 and 0.7 r for 0.35, 0.5, 0.7 and 0.9
CIRCLE = 0.5
# Distance of the samples that are asked, in tip radii: ten to a radius of the circle
SET_APART = 0.05
# Samples to either side that a circle may reach: its diameter
CIRCLE_SAMPLES = round(2.0 * CIRCLE / SET_APART)
# Share of its radius by which a circle has too little room. At a (in radii) past a right-angled corner one that leans
# back lacks a, and one that leans on by the angle f so that both legs are as near, cos f - sin f = a, lacks 1 - cos f:
# the least of both is largest where they are equal, 0.2. Half of that is asked
NO_ROOM = 0.1
# Most of that which noise may take. Of the 48 sections, five times each, in noise of which FEATURE_RESIDUAL_SDS take so
# much, 0 are told as lifted at 0.4, 2 at 0.5, 59 at 0.6 and all from 0.8 on
NOISE_TAKES = 1.0 / 3.0
# Directions in which the circle is tried, from one side to the other: 7.5 degrees apart, off by 0.002 of its radius
CIRCLE_LEANS = 25
# Samples that tell whether anything stands so far off the base at all: of a log of 10^8, lifts of 5000 are seen
GLANCE_SAMPLES = 20_000
# A rise goes aside by less than this share of its height, 75 degrees steep. Up an edge of a height H up to r a ball
# goes sqrt(2 r H - H^2) aside, more than H, and up a wall r: that is one of 3.7 r, which is no fine feature
LIFTS_ASIDE = 0.27
# Samples over a face have its direction, to 2.6 degrees by its cosine: the others are on their way about an edge
OVER_FACE = 0.999
# Bases of so few parameters that they follow no finger into the air
OF_FEW_PARAMETERS = ("plane", "quadric", "cylinder", "sphere")
# A stretch of contact that is no way back and forth spans this share of its length: a row 1, a half circle 0.64, two
# rows beside each other 0
SPANNED_SHARE = 0.5
# Samples whose circles are held against their neighbours at once: 8 MB
AT_ONCE = 1000


@dataclass(frozen=True, eq=False)
class Lifted:
    """What of a recording is no contact.

    Args:
        felt: (N,) False for the samples of the trace that were taken in the air.
        pieces: number of paths through the air.
        length: of these together, m.
        highest: of these over the base, m.
        tip_radius: m.
        as_walls: True if a body with walls explains these paths as well.
        inwards: True if they leave the base to the side that the body was taken to lie on.
    """

    felt: BoolArray
    pieces: int
    length: float
    highest: float
    tip_radius: float
    as_walls: bool = False
    inwards: bool = False

    def record(self) -> dict[str, Any]:
        """JSON values, SI units."""
        samples = int((~self.felt).sum())
        told = {"pieces": self.pieces, "length": self.length, "highest": self.highest, "samples": samples}
        return told | {"as_walls": self.as_walls, "inwards": self.inwards}

    def sentence(self) -> str:
        """What was left out, for people."""
        times = "once" if self.pieces == 1 else f"{self.pieces} times"
        corners = f"no ball of {length_text(self.tip_radius)} that touches turns such corners"
        walls = "walls would explain them as well" if self.as_walls else corners
        return (
            f"the finger was lifted {times}, up to {length_text(self.highest, 2)} off the base: "
            f"{length_text(self.length, 2)} of path through the air were left out ({walls}; if it touched there, say "
            "--in-contact)"
        )


def lifted(laid: LaidTrace, side_known: bool = False) -> Lifted | None:
    """Which samples of a trace were taken in the air; None if none is known to be.

    A lift lower than half a radius, or round corners as wide as that, looks like something that was felt. Strokes up
    and down at the ends of every row are the walls of a tray, or lifts: they are taken for lifts if a smooth body
    explains all the rest. Where none is on the side from which the base was taken to be felt, lifts to the other side
    say that it was felt from there: at their feet, too, are corners, where a pocket has round brims.

    Args:
        laid: the recording.
        side_known: True if it is certain from which side the base was felt.
    """
    found = _lifted(laid)
    if found is None and laid.base.kind == "polyhedron":
        found = _off_a_face(laid, side_known)
    if found is None and laid.base.kind in OF_FEW_PARAMETERS and not side_known:
        found = _lifted(laid, inwards=True)
    return found


def _off_a_face(laid: LaidTrace, side_known: bool) -> Lifted | None:
    """What rises off one face of a body, where all that rises may be lifts."""
    faces = np.array(laid.base.parameters["normals"])
    over = laid.feet().normals @ faces.T > OVER_FACE
    for face in np.argsort(-over.sum(axis=0)):
        if over[:, face].sum() < SHORTEST_SWEEP_SAMPLES:
            break
        floor = LaidTrace(laid, fit_base(laid.select(over[:, face]), tested=False))
        found = _lifted(floor)
        if found is None and not side_known:
            found = _lifted(floor, inwards=True)
        if found is None or not _straight(laid, found.felt):
            continue
        if fit_base(laid.select(found.felt), tested=False).kind in OF_FEW_PARAMETERS:
            return replace(found, as_walls=True)
    return None


def _straight(trace: Trace, felt: BoolArray) -> bool:
    """True if no stretch of contact goes back and forth: then the finger came down anew for every row."""
    cuts = np.flatnonzero(np.diff(felt.astype(np.int8))) + 1
    stretches = [each for each in np.split(np.arange(len(trace)), cuts) if felt[each[0]] and len(each) > 1]
    spans = [np.linalg.norm(trace.centers[each[-1]] - trace.centers[each[0]]) for each in stretches]
    lengths = [_path(trace.centers[each], SET_APART * trace.tip_radius) for each in stretches]
    return all(span > SPANNED_SHARE * length for span, length in zip(spans, lengths, strict=True))


def _path(places: FloatArray, spacing: float) -> float:
    """Length of a path through places (N, 3), m, without what noise adds on less than `spacing`."""
    from mapping.detection.path.lifted_kernels import set_apart

    return float(np.linalg.norm(np.diff(places[set_apart(places, spacing)], axis=0), axis=1).sum())


def _lifted(laid: LaidTrace, inwards: bool = False) -> Lifted | None:
    """What rises off a base to one side of it, round corners or at an end."""
    tip, radius, sign = laid.tip_radius, CIRCLE * laid.tip_radius, -1.0 if inwards else 1.0
    some = np.arange(0, len(laid), 1 + len(laid) // GLANCE_SAMPLES)
    if len(laid) < 3 or not (sign * laid.feet(some).height > radius).any():
        return None
    from mapping.detection.path.lifted_kernels import set_apart

    height = sign * laid.feet().height
    unsure = FEATURE_RESIDUAL_SDS * robust_sd(np.diff(height, 2)) / np.sqrt(6.0)
    if unsure > NOISE_TAKES * NO_ROOM * radius:
        return None
    at = set_apart(laid.centers, SET_APART * tip)
    steps = np.linalg.norm(np.diff(laid.centers[at], axis=0), axis=1)
    aside = np.append(0.0, np.cumsum(np.sqrt(np.maximum(steps**2 - np.diff(height[at]) ** 2, 0.0))))
    felt, pieces, length = np.ones(len(laid), dtype=bool), 0, 0.0
    # where the finger was set down elsewhere, without a sample on the way, one path ends and another begins
    borders, past = [0, *(np.flatnonzero(steps > 2.0 * tip) + 1), len(at)], np.append(at, len(laid))
    for begin, end in pairwise(borders):
        way, up = aside[begin:end], height[at[begin:end]]
        for first, last in _paths_through_air(way, up, unsure, tip):
            around = slice(max(0, first - CIRCLE_SAMPLES), last + 1 + CIRCLE_SAMPLES)
            if inwards and not _turns_too_sharply(way[around], -up[around], radius):
                continue
            # their feet were touched, but for the ends of a recording
            felt[at[begin + first] + (first > 0) : past[begin + last + (last == end - begin - 1)]] = False
            length += float(steps[begin + first : begin + last].sum())
            pieces += 1
    return Lifted(felt, pieces, length, float(height[~felt].max()), tip, inwards=inwards) if pieces else None


def _paths_through_air(aside: FloatArray, height: FloatArray, unsure: float, tip: float) -> list[tuple[int, int]]:
    """Both feet of each path through the air amid samples that are set apart.

    Args:
        aside: (n,) way along the base, m.
        height: (n,) over it, m.
        unsure: what noise may add to a height, m.
        tip: radius of the ball, m.
    """
    high = np.concatenate([[0], height > CIRCLE * tip, [0]])
    found = list[tuple[int, int]]()
    for start, stop in np.flatnonzero(np.diff(high)).reshape(-1, 2):
        if found and start <= found[-1][1]:
            continue
        first, last = (_foot(aside, height, int(at), way, unsure, tip) for at, way in ((start, -1), (stop - 1, 1)))
        along, up = aside[first : last + 1], height[first : last + 1]
        if np.hypot(np.diff(along), np.diff(up)).sum() < LONGEST_RUN * tip:
            continue  # what is shorter may be a wrong reading (see outliers)
        at_an_end = first == 0 or last == len(height) - 1
        if (at_an_end and along[-1] - along[0] < LIFTS_ASIDE * np.ptp(up)) or _turns_too_sharply(
            along, up, CIRCLE * tip
        ):
            found.append((first, last))
    return found


def _foot(aside: FloatArray, height: FloatArray, at: int, way: int, unsure: float, tip: float) -> int:
    """The sample before (way -1) or behind (1) a place from which on the path sinks no further within a radius."""
    along, up = (aside[at:], height[at:]) if way > 0 else (aside[at::-1], height[at::-1])
    gone = np.append(0.0, np.cumsum(np.hypot(np.diff(along), np.diff(up))))
    foot = 0
    while True:
        near = up[foot : np.searchsorted(gone, gone[foot] + tip, side="right")]
        further = int((near <= near.min() + unsure).argmax())  # the first that is as low but for the noise
        if further == 0:
            return at + way * foot
        foot += further


def _turns_too_sharply(aside: FloatArray, height: FloatArray, radius: float) -> bool:
    """True if under some sample of a path no circle fits that keeps clear of all others."""
    lean = np.linspace(-0.5 * np.pi, 0.5 * np.pi, CIRCLE_LEANS)
    right, down = radius * np.sin(lean)[:, None], radius * np.cos(lean)[:, None]
    beside = np.arange(-CIRCLE_SAMPLES, CIRCLE_SAMPLES + 1)
    for part in np.array_split(np.arange(len(aside)), 1 + len(aside) // AT_ONCE):
        others = np.clip(part[:, None] + beside, 0, len(aside) - 1)
        away = aside[others] - aside[part, None], height[others] - height[part, None]
        room = np.hypot(away[0][:, None, :] - right, away[1][:, None, :] + down)
        if (room.min(axis=2).max(axis=1) < (1.0 - NO_ROOM) * radius).any():
            return True
    return False
