"""Stability of detection: the named extremes of size, spacing, noise and place, and invariances."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from explore3d.bench.scenes import (
    DIAMETER,
    HALF,
    SAMPLE_SPACING,
    TIP_RADIUS,
    Heights,
    features,
    plate,
    scaled,
    sweeps,
    wire,
)
from explore3d.stability.table import Answer, Case
from mapping import (
    Feature,
    FloatArray,  # fmt: skip
    MappingError,
    Trace,
)
from mapping.base import Base
from mapping.detection import Detections, detect
from mapping.geometry.templates import groove_height, step_height
from mapping.inference.kinds import kind_made_of, kind_of

WHITE_NOISE = 0.2e-3


def told(detections: Detections, found: tuple[Feature, ...]) -> str:
    """What was found, in a few words."""
    kinds = [f"{each.kind} {each.height.median * 1e3:.3g} mm high" for each in found[:4]]
    limit = f"limit {detections.detection_limit * 1e3:.2g} mm"
    return f"{', '.join(kinds) or 'nothing'} ({len(detections.crossings)} crossings, {limit})"


def outcome(
    make: Callable[[], Trace], right: Callable[[Detections, tuple[Feature, ...]], bool], reason: str
) -> Callable[[], Answer]:
    """Detection and grammar on a trace; `right` judges what came out."""

    def run() -> Answer:
        detections, found = features(make())
        return Answer(told(detections, found), reason=reason, holds=right(detections, found))

    return run


def refused(make: Callable[[], object], reason: str) -> Callable[[], Answer]:
    """The input cannot be used: an error in words must say so."""

    def run() -> Answer:
        try:
            made = make()
        except MappingError as error:
            return Answer(f"refused: {error}", reason=reason)
        return Answer(f"accepted: {made}", reason=reason, holds=False)

    return run


def _ridges(count: int, height: float, within: float) -> Callable[[Detections, tuple[Feature, ...]], bool]:
    """So many ridges, each of that height within so many m."""

    def right(_: Detections, found: tuple[Feature, ...]) -> bool:
        return len(found) == count and all(
            _is_ridge(each) and abs(each.height.median - height) <= within for each in found
        )

    return right


def _is_ridge(feature: Feature) -> bool:
    return kind_of(feature) is kind_made_of("convex", line=True)


def _nothing(_: Detections, found: tuple[Feature, ...]) -> bool:
    return not found


def _silent(detections: Detections, found: tuple[Feature, ...]) -> bool:
    return not found and len(detections.left_out) > 0


def _near(*places: float) -> Callable[[Detections, tuple[Feature, ...]], bool]:
    """Every one of the wires at these y lies under some ridge, and nothing lies elsewhere, within 0.4 mm."""

    def right(_: Detections, found: tuple[Feature, ...]) -> bool:
        if not found or not all(map(_is_ridge, found)):
            return False
        y = np.concatenate([each.axis[:, 1] for each in found])
        gaps = np.abs(y[:, None] - np.array(places))
        return bool(gaps.min(axis=0).max() < 0.4e-3 and gaps.min(axis=1).max() < 0.4e-3)

    return right


def _faint(detections: Detections, found: tuple[Feature, ...]) -> bool:
    """No sweep sees the wire, and says so; what many sweeps agree on is the wire's height, within its interval."""
    right = [_is_ridge(f) and f.height.low <= DIAMETER <= f.height.high for f in found]
    near = [np.abs(f.axis[:, 1]).max() < 0.3 * np.sqrt(2 * TIP_RADIUS * DIAMETER) for f in found]
    return detections.detection_limit > DIAMETER and len(found) <= 1 and all(right) and all(near)


def _anything(_: Detections, found: tuple[Feature, ...]) -> bool:
    return True


def _flat(feet: FloatArray) -> FloatArray:
    return np.zeros(len(feet))


def _both(*parts: Heights) -> Heights:
    return lambda feet: np.maximum.reduce([part(feet) for part in parts])


def _groove(width: float) -> Heights:
    return lambda feet: groove_height(feet[:, 1], width, TIP_RADIUS)


def _step(height: float) -> Heights:
    return lambda feet: step_height(feet[:, 1], height, TIP_RADIUS)


def _standing() -> Trace:
    """A finger that does not move."""
    count = 500
    return Trace(
        2e-4 * np.arange(float(count)),
        np.tile([0.0, 0.0, TIP_RADIUS], (count, 1)),
        np.zeros(count, dtype=int),
        TIP_RADIUS,
    )


def _not_a_number() -> Trace:
    good = sweeps(wire())
    centers = good.centers.copy()
    centers[77, 2] = np.nan
    return Trace(good.t, centers, good.sweep, TIP_RADIUS)


def _few() -> Trace:
    return sweeps(wire(), spacing=4e-3)


def _summary(trace: Trace, base: Base, scale: float, origin: FloatArray) -> FloatArray:
    """Places and heights of all crossings, each over its own size; false alarms are counted by the same length."""
    found = detect(trace, base, false_alarms_per_metre=0.01 / scale)
    rows = [[*((c.point - origin) / scale / HALF), c.height / scale / DIAMETER] for c in found.crossings]
    return np.array(rows)


def invariant(scale: float, distance: float = 0.0) -> Callable[[], Answer]:
    """The same crossings in another unit of length, or far from the coordinates' origin."""

    def run() -> Answer:
        trace = sweeps(wire(angle=0.1), white=WHITE_NOISE)
        origin = distance * np.array([1.0, -1.0, 1.0])
        moved = scaled(trace, scale, origin)
        if distance:  # what the far coordinates can hold is the input of both
            trace = scaled(moved, 1.0, -origin)
        here = _summary(trace, plate(), 1.0, np.zeros(3))
        there = _summary(moved, plate(scale=scale, at=origin.tolist()), scale, origin)
        if here.shape != there.shape or not len(here):
            return Answer(f"{len(there)} crossings, {len(here)} at home", holds=False)
        error, far = float(np.abs(here - there).max()), max(1.0, distance / DIAMETER)
        reason = "heights are differences of coordinates" if distance else "thresholds go up a ladder of 1 % steps"
        return Answer(f"{len(there)} crossings, the same", error, far, 0.0 if distance else 1e-9, reason)

    return run


PARALLEL_SWEEP_PLACES = (-3e-3, -1.5e-3, 0.0, 1.5e-3, 3e-3)
DETECTION_CASES = [
    Case("detection", "thinner than the spacing", "a wire of 2 um, samples every 6 um, no noise",
         outcome(lambda: sweeps(wire(2e-6)), _ridges(1, 2e-6, 2e-8), "the ball magnifies it: a trace 0.4 mm wide")),
    Case("detection", "D = 2 r", "a wire as thick as the ball",
         outcome(lambda: sweeps(wire(2 * TIP_RADIUS), half=40e-3), _anything,
                 "wider than four tip radii is no fine feature")),
    Case("detection", "two wires closer than 2 x_c", "5 mm apart, traces 7.2 mm wide",
         outcome(lambda: sweeps(_both(wire(y=-2.5e-3), wire(y=2.5e-3)), white=WHITE_NOISE), _near(-2.5e-3, 2.5e-3),
                 "their traces meet in a kink between them")),
    Case("detection", "two wires just apart", "8 mm apart, traces 7.2 mm wide",
         outcome(lambda: sweeps(_both(wire(y=-4e-3), wire(y=4e-3)), white=WHITE_NOISE), _near(-4e-3, 4e-3),
                 "the plate between them is seen")),
    Case("detection", "two wires that touch", "0.65 mm apart: both, or one ridge to this ball",
         outcome(lambda: sweeps(_both(wire(y=-0.325e-3), wire(y=0.325e-3)), white=WHITE_NOISE),
                 lambda _, f: any(_ridges(count, DIAMETER, 6e-5)(_, f) for count in (1, 2)),
                 "the ball rests on both: the kink is 5 um deep")),
    Case("detection", "wire parallel to the sweeps", "five sweeps along it, the middle one on its crest",
         outcome(lambda: sweeps(wire(half=4e-3), places=PARALLEL_SWEEP_PLACES, along_x=True, white=WHITE_NOISE),
                 lambda _, f: len(f) >= 1, "its ends are crossed by every sweep")),
    Case("detection", "groove 0.1 mm wide, no noise", "a dip of 0.125 um",
         outcome(lambda: sweeps(_groove(0.1e-3)), lambda _, f: any(each.height.median < 0 for each in f),
                 "the noise floor is the rounding of contact geometry, 1e-8 r")),
    Case("detection", "groove 0.1 mm wide, 0.2 mm of noise", "a dip of 0.125 um",
         outcome(lambda: sweeps(_groove(0.1e-3), white=WHITE_NOISE), _nothing, "a 1600th of the noise: out of reach")),
    Case("detection", "no noise at all", "sigma = 0",
         outcome(lambda: sweeps(wire()), _ridges(1, DIAMETER, 0.01 * DIAMETER), "the best filter, before any fit")),
    Case("detection", "noise of 10 D", "sigma = 6.5 mm, D = 0.65 mm",
         outcome(lambda: sweeps(wire(), white=6.5e-3), _faint, "limit above the wire: only many sweeps see it")),
    Case("detection", "plain plate, no noise", "constant height",
         outcome(lambda: sweeps(_flat), _nothing, "nothing there, nothing found")),
    Case("detection", "plain plate, noise", "0.2 mm",
         outcome(lambda: sweeps(_flat, white=WHITE_NOISE), _nothing, "0.01 false alarms a metre")),
    Case("detection", "constant trace", "the finger stands still",
         outcome(_standing, _nothing, "no length to inspect; said in left_out")),
    Case("detection", "NaN samples", "one sample of 20 000", refused(_not_a_number, "a trace must be finite")),
    Case("detection", "six samples a sweep", "every 4 mm",
         outcome(_few, _silent, "too few to inspect; said in left_out")),
    Case("detection", "step of 0.95 r", "contact 87 degrees round the ball",
         outcome(lambda: sweeps(_step(0.95 * TIP_RADIUS), half=40e-3), lambda d, _: len(d.crossings) > 0,
                 "a vertical wall at the step's edge")),
    Case("detection", "at the border", "a wire 0.3 mm from where the sweeps end",
         outcome(lambda: sweeps(wire(y=HALF - 0.3e-3), white=WHITE_NOISE), lambda _, f: len(f) == 1,
                 "half of it is seen")),
    Case("detection", "1 sample in 6 um, 1 in 0.6 mm", "samples a hundred times sparser",
         outcome(lambda: sweeps(wire(), spacing=100 * SAMPLE_SPACING, white=0.02e-3), _ridges(1, DIAMETER, 6e-5),
                 "12 samples over the wire's trace")),
    *[Case("detection", f"unit of {scale:g} m", "the same crossings", invariant(scale))
      for scale in (1e-9, 1e-6, 1e-3, 1e3, 1e6)],
    Case("detection", "origin 1 km away", "the same crossings", invariant(1.0, 1e3)),
    Case("detection", "origin 1000 km away", "the same crossings", invariant(1.0, 1e6)),
]  # fmt: skip
