"""Feel: a person, or a simulated hand, feels a model through a display; what was felt is a log like any other."""

from __future__ import annotations

import itertools
import sys
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from explore3d import UserError, __version__
from explore3d.log import LogWriter
from explore3d.report.display.devices import SIMULATED, display_device
from hw import Move
from hw.display import Display, DisplayLoop, Rendering, Run, SimulatedDisplay
from mapping import FloatArray, LeftOut, ObjectModel, Trace
from mapping.geometry.mesh import directions, middle, resample
from mapping.geometry.proxy import ProxyBody
from mapping.model import touchable

# The simulated hand crosses a feature over so many contact half-widths of a sharp crest to either side
HAND_CROSSING_REACH = 3.0
# s that the simulated hand takes from one crossing to the next, off the body
LIFT_TIME = 0.5
# Between places whose normals agree better than this the hand moves straight; else by so many corners round the body
LEVEL_COSINE, TURN_CORNERS = 0.7, 17
# Force with which the simulated hand presses, N: as people do who look for details (Smith, Gosselin and Houde 2002)
HAND_FORCE = 0.5


@dataclass(frozen=True, eq=False)
class Felt:
    """What came of a display.

    Args:
        run: its records.
        trace: the proxy's centres while it touched, a sweep for each time that it came down.
        left_out: features that have no closed form to be felt.
        passive_stiffness: Colgate's limit 2 b / T, N/m.
        tip_radius: of the proxy, m; period: of the steps, s.
    """

    run: Run
    trace: Trace
    left_out: tuple[LeftOut, ...]
    passive_stiffness: float
    tip_radius: float
    period: float

    def lines(self) -> list[str]:
        """What the terminal is told."""
        run = self.run
        force = np.linalg.norm(run.forces, axis=1) if len(run.records) else np.zeros(1)
        late, computing = (1e6 * run.column(name) for name in ("late", "computing"))
        lines = [f"{run.steps} steps, {run.reason}; {len(self.trace)} of them in contact"]
        if len(late) and late.any():
            lines.append(
                f"late by {np.median(late):.1f} µs in the middle, by {np.quantile(late, 0.999):.0f} µs in 99.9 %, "
                f"by a period or more in {100.0 * np.mean(late > 1e6 * self.period):.2g} %; "
                f"a step takes {np.median(computing):.1f} µs, {np.quantile(computing, 0.999):.0f} µs at most in 99.9 %"
            )
        if run.lost:
            lines.append(f"{run.lost} records came too fast to be kept")
        least = float(run.column("energy").min()) if len(run.records) else 0.0
        lines.append(
            f"force up to {force.max():.3g} N; energy made by the display: {1e6 * max(0.0, -least):.3g} µJ at most"
        )
        lines += [f"not felt: {each.stage}, {each.reason}" for each in self.left_out]
        return lines

    def record(self) -> dict[str, Any]:
        """The same as JSON values."""
        run = self.run
        empty = len(run.records) == 0
        late, computing = run.column("late"), run.column("computing")
        return {
            "steps": run.steps,
            "reason": run.reason,
            "samples": len(self.trace),
            "late": None if empty else {"median": float(np.median(late)), "p999": float(np.quantile(late, 0.999))},
            "computing": None
            if empty
            else {"median": float(np.median(computing)), "p999": float(np.quantile(computing, 0.999))},
            "largest_force": 0.0 if empty else float(np.linalg.norm(run.forces, axis=1).max()),
            "least_energy": 0.0 if empty else float(run.column("energy").min()),
            "passive_stiffness": self.passive_stiffness,
            "left_out": [each.stage for each in self.left_out],
        }


def feel(
    model: ObjectModel | Path | str,
    device: str | Display = SIMULATED,
    *,
    tip_radius: float | None = None,
    exaggeration: float = 1.0,
    rendering: Rendering | None = None,
    rate: float = 1000.0,
    speed: float = 30e-3,
    seconds: float | None = None,
    paced: bool = True,
    log: Path | str | None = None,
    look: Callable[[FloatArray], bool] | None = None,
) -> Felt:
    """Feel a model.

    Args:
        model: an annotated model, its folder or its model.json.
        device: "simulated", the name of an installed one, or one that is at hand.
        tip_radius: of the proxy, m; None: the one that explored the model.
        exaggeration: of the features' sections, 1 to 100.
        rendering: stiffness, friction, damping, scale; its origin is where the device's is.
        rate, speed: of the simulated device (steps/s), and of its hand along its crossings (m/s).
        seconds: how long; None: until the simulated hand has crossed every feature, or until `look` stops a real one.
        paced: False lets the simulated device run as fast as it can.
        log: file for the record, in the format of all logs; None: none.
        look: is shown records while it runs; True stops it.

    Raises:
        UserError: no such device, no tip radius known, a model or a log that cannot be read or written.
        MappingError, FingerError: what cannot be felt so.
    """
    rendering = Rendering() if rendering is None else rendering
    known = model if isinstance(model, ObjectModel) else ObjectModel.load(model)
    radius = _tip(known, tip_radius)
    body, left_out = touchable(known, radius, exaggeration)
    if isinstance(device, str) and device == SIMULATED:
        wishes = hand_path(known, body, rendering, rate, speed)
        scale, origin = rendering.scale, np.asarray(rendering.origin)
        device = SimulatedDisplay((wishes - origin) / scale, rate=rate)
        steps = len(wishes) if seconds is None else max(1, round(seconds * rate))
    else:
        device = display_device(device) if isinstance(device, str) else device
        paced, rate = True, device.rate
        steps = np.iinfo(np.int64).max if seconds is None else max(1, round(seconds * rate))
    with ExitStack() as stack:
        writer = None
        if log is not None:
            about = {"version": __version__, "display": device.info, "stiffness": rendering.stiffness}
            writer = stack.enter_context(LogWriter(log, tip_radius=radius, metadata=about))
        stack.enter_context(device)
        loop = DisplayLoop(device, body, rendering)
        watched = look if writer is None else _Recorder(writer, radius, look)
        run = loop.run(steps, paced=paced, look=watched)
        trace = felt_trace(run.records, radius)
        if writer is not None:
            for number in np.unique(trace.sweep):
                sweep = trace.select(trace.sweep == number)
                writer.write(_move(sweep, speed), sweep)
    return Felt(run, trace, left_out, loop.passive_stiffness, radius, 1.0 / rate)


def _tip(model: ObjectModel, tip_radius: float | None) -> float:
    known = tip_radius if tip_radius is not None else model.provenance.get("tip_radius")
    if known is None:
        raise UserError('the model does not say which tip explored it; give one with --tip-radius, for example "5 mm"')
    return float(known)


def felt_trace(records: FloatArray, radius: float, sweeps: int = 0, inside: bool = False) -> Trace:
    """The proxy's centres while it touched, a sweep for each time that it came down.

    Args:
        records: (N, 14) of a run.
        radius: of the proxy, m.
        sweeps: how many there were before; inside: whether the last one still goes on.
    """
    run = Run(records, "", len(records), 0)
    touching = run.column("touching") > 0.0
    begins = touching & ~np.append(inside, touching[:-1])
    sweep = sweeps + np.cumsum(begins)[touching]
    return Trace(run.column("t")[touching], run.centers[touching], sweep, radius, force=-run.forces[touching])


class _Recorder:
    """Has every sample on disk within a fraction of a second: whatever ends the program costs nothing that was felt."""

    def __init__(self, writer: LogWriter, radius: float, look: Callable[[FloatArray], bool] | None) -> None:
        self._writer, self._radius, self._look = writer, radius, look
        self._sweeps, self._inside = 0, False

    def __call__(self, records: FloatArray) -> bool:
        trace = felt_trace(records, self._radius, self._sweeps, self._inside)
        if len(trace):
            self._sweeps = int(trace.sweep[-1])
            self._writer.felt(trace)
        self._inside = bool(records[-1, 10] > 0.0)
        return self._look is not None and self._look(records)


def _move(sweep: Trace, speed: float) -> Move:
    force = sweep.force if sweep.force is not None else np.zeros((1, 3))
    way = force.mean(axis=0)
    size = float(np.linalg.norm(way))
    approach = way / size if size > 0.0 else np.array([0.0, 0.0, -1.0])
    return Move(sweep.centers[[0, -1]], approach, speed=speed, force=max(size, 1e-9), purpose="sweep")


def hand_path(
    model: ObjectModel, body: ProxyBody, rendering: Rendering, rate: float, speed: float, across: int = 3
) -> FloatArray:
    """(N, 3) places of a hand that crosses every feature there and back, m on the body, one for each step.

    A line is crossed at `across` places along it, a point in two directions. A model without features is crossed once
    over the middle of its base.
    """
    radius = body.radius
    depth = HAND_FORCE / rendering.stiffness * rendering.scale
    lift = radius + body.top + 0.2 * radius
    strokes: list[tuple[FloatArray, FloatArray]] = []
    for place, normal, way, reach in _crossings(model, radius, across):
        count = max(2, round(2.0 * reach / (speed * rendering.scale) * rate))
        there = np.linspace(-reach, reach, count)
        along = np.concatenate([there, there[::-1]])[:, None] * way
        feet = body.base.query(place + along + radius * normal)
        level = feet.points + (radius - depth) * normal
        fall = np.linspace(0.0, 1.0, max(2, round(0.5 * LIFT_TIME * rate)))[:, None]
        above = level[0] + (lift + depth - radius) * normal
        stroke = [(1.0 - fall) * above + fall * level[0], level, (1.0 - fall) * level[-1] + fall * above]
        strokes.append((np.concatenate(stroke), normal))
    joined = [strokes[0][0]]
    for (before, leaving), (after, coming) in itertools.pairwise(strokes):
        joined += [_way_round(before[-1], leaving, after[0], coming, body, max(2, round(LIFT_TIME * rate))), after]
    return np.concatenate(joined)


def _way_round(
    start: FloatArray, leaving: FloatArray, end: FloatArray, coming: FloatArray, body: ProxyBody, steps: int
) -> FloatArray:
    """(steps, 3) places from one to another: straight over one side of the body, else round a sphere about it."""
    center, half = body.base.surface.bounds.mean(axis=0), 0.5 * body.base.surface.size
    corners = [start, end]
    if leaving @ coming < LEVEL_COSINE:
        out = half + 2.0 * body.radius
        first, last = start + out * leaving - center, end + out * coming - center
        turn = np.linspace(0.0, 1.0, TURN_CORNERS)[:, None]
        round_it = (1.0 - turn) * first + turn * last
        round_it += 1e-3 * half * np.sin(np.pi * turn) * np.cross(leaving, np.roll(coming, 1))  # opposite ends meet
        size = np.linalg.norm(round_it, axis=1, keepdims=True)
        corners = [start, *(center + np.maximum(1.0, 1.5 * out / size) * round_it), end]
    return resample(np.array(corners), steps)


def _crossings(
    model: ObjectModel, radius: float, across: int
) -> list[tuple[FloatArray, FloatArray, FloatArray, float]]:
    """Middle, normal, direction and reach of each crossing."""
    found = []
    for feature in model.features:
        size = np.sqrt(2.0 * radius * abs(feature.height.median)) + 0.5 * max(feature.width.median, 0.0)
        reach = HAND_CROSSING_REACH * float(size)
        if len(feature.axis) == 1:
            normal = feature.normals[0]
            first = np.cross(normal, np.eye(3)[int(np.abs(normal).argmin())])
            first /= np.linalg.norm(first)
            found += [(feature.axis[0], normal, way, reach) for way in (first, np.cross(normal, first))]
            continue
        places = np.unique(np.linspace(0, len(feature.axis) - 1, across + 2).astype(np.int64)[1:-1])
        tangents = directions(feature.axis)
        if len(feature.axis) == 2:  # between the two ends
            _, tangent = middle(feature.axis)
            shares = np.linspace(0.0, 1.0, across + 2)[1:-1, None]
            points = (1.0 - shares) * feature.axis[0] + shares * feature.axis[1]
            found += [(p, feature.normals[0], np.cross(feature.normals[0], tangent), reach) for p in points]
            continue
        found += [
            (feature.axis[k], feature.normals[k], np.cross(feature.normals[k], tangents[k]), reach) for k in places
        ]
    if not found:
        box = model.base.surface.bounds
        near = model.base.nearest.query(box.mean(axis=0)[None])
        normal = near.normals[0]
        way = np.cross(normal, np.eye(3)[int(np.abs(normal).argmin())])
        found = [(near.points[0], normal, way / np.linalg.norm(way), 0.25 * model.base.surface.size)]
    return found


def live(model: ObjectModel) -> Callable[[FloatArray], bool]:
    """What a terminal is shown while a display runs: one line on stderr that is written over."""
    axes = [(feature.id, feature.axis) for feature in model.features]

    def look(records: FloatArray) -> bool:
        run = Run(records, "", 0, 0)
        here, force = records[-1, 4:7], float(np.linalg.norm(run.forces[-1]))
        reach = {name: float(np.linalg.norm(axis - here, axis=1).min()) for name, axis in axes}
        nearest = min(reach, key=reach.__getitem__) if reach and run.column("touching")[-1] else "-"
        bar = "#" * min(20, round(20.0 * force / 3.0))
        late = 1e6 * float(np.quantile(run.column("late"), 0.99))
        place = " ".join(f"{1e3 * each:8.2f}" for each in here)
        print(f"\r{place} mm  {force:5.2f} N {bar:<20} {nearest:<12} late {late:5.0f} µs", end="", file=sys.stderr)
        return False

    return look
