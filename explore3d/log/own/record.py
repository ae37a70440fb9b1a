"""Log: what was recorded, as the analysis takes it, be it from our own log or from a table.

The base is an event of the log: it can be analysed where the scene's mesh files are not at hand.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from explore3d import UserError, count_text
from hw import Move
from mapping import NoiseError, Surface, SurfaceError, Trace
from mapping.base import Base, Form
from mapping.instrument import Noise
from mapping.model import Tolerance

if TYPE_CHECKING:
    from mapping.detection import Detections


@dataclass(frozen=True)
class Event:
    """Something noted beside the samples.

    Args:
        kind: "move", or the kind that its writer gave.
        t: time on the clock of the samples, s; None before the first sample.
        data: JSON values; of a move its path, approach, speed, force, purpose, first sample and count.
    """

    kind: str
    t: float | None
    data: dict[str, Any]


def move_event(move: Move, t: float | None, first: int, samples: int) -> Event:
    """What a log notes of a move.

    Args:
        move: as it was commanded.
        t: on the clock of the samples when it began, s; None before the first sample.
        first: number of samples before it.
        samples: that it gave.
    """
    data = {
        "purpose": move.purpose,
        "path": move.path.tolist(),
        "approach": move.approach.tolist(),
        "speed": move.speed,
        "force": move.force,
    }
    return Event("move", t, data | {"first": first, "samples": samples})


@dataclass(frozen=True, eq=False)
class Log:
    """A recording.

    Args:
        trace: all samples in the order of writing.
        scene_text: the scene file as it was when recorded; "" if there is none (a table).
        events: what was noted beside the samples, in the order of writing.
        metadata: versions, seed, finger, columns: what the writer or the import knew.
        complete: True if the log was closed and every sample that it promised is here.
        recovered: one sentence on what was lost or left out, "" if nothing.
        sha256: of the file's bytes (of several files: of their digests joined by newlines).
        sources: paths of the files.
        detections: of a log that was searched while it streamed by; `trace` is then what is left of it.
        tip_sd: standard deviation of the tip's radius, m; None: the scene says it.
        tip_sd_assumed: True if nobody stated it.
        form: what the base is, where it is fitted.
        tolerances: what the drawing allows; None: what the scene says.
        in_contact: True if whoever recorded vouches that the finger touched at every sample.
        timed: False if nobody recorded times: `trace.t` counts the samples then, for no clock went with them.
    """

    trace: Trace
    scene_text: str = ""
    events: tuple[Event, ...] = ()
    metadata: dict[str, Any] = field(default_factory=dict)
    complete: bool = True
    recovered: str = ""
    sha256: str = ""
    sources: tuple[str, ...] = ()
    detections: Detections | None = None
    tip_sd: float | None = None
    tip_sd_assumed: bool = False
    form: Form = Form()  # noqa: RUF009
    tolerances: tuple[Tolerance, ...] | None = None
    in_contact: bool = True
    timed: bool = True

    @cached_property
    def felt_sha256(self) -> str:
        """Of where the centre was, whatever file says it: a simulation that is run again with its seed has the same."""
        return hashlib.sha256(np.ascontiguousarray(self.trace.centers).data).hexdigest()


def merge(logs: Sequence[Log]) -> Log:
    """Several recordings of one object as one; sweeps of later ones are renumbered so that none coincide.

    Raises:
        UserError: none given, or tip radii that differ.
    """
    if not logs:
        raise UserError("no logs given; at least one is needed")
    if len(logs) == 1:
        return logs[0]
    first = logs[0]
    for log in logs[1:]:
        if log.trace.tip_radius != first.trace.tip_radius:
            raise UserError(
                f"{_name(log)}: field tip_radius is {log.trace.tip_radius:g} m, but {first.trace.tip_radius:g} m in "
                f"{_name(first)}; logs to analyse together must share one fingertip"
            )
    traces, events, samples, sweeps = [], [], 0, 0
    for log in logs:
        sweep = log.trace.sweep - log.trace.sweep.min() + sweeps
        traces.append(replace(log.trace, sweep=sweep))
        events += [_shifted(event, samples) for event in log.events]
        samples, sweeps = samples + len(log.trace), int(sweep.max()) + 1
    read_as = [f"{_name(log)}: {line}" for log in logs for line in log.metadata.get("read_as", [])]
    return Log(
        trace=Trace.concatenate(traces),
        scene_text=next((log.scene_text for log in logs if log.scene_text), ""),
        events=tuple(events),
        metadata=first.metadata | ({"read_as": read_as} if read_as else {}),
        complete=all(log.complete for log in logs),
        recovered="; ".join(f"{_name(log)}: {log.recovered}" for log in logs if log.recovered),
        sha256=hashlib.sha256("\n".join(log.sha256 for log in logs).encode()).hexdigest(),
        sources=tuple(source for log in logs for source in log.sources),
        tip_sd=max((log.tip_sd for log in logs if log.tip_sd is not None), default=None),
        tip_sd_assumed=any(log.tip_sd_assumed for log in logs),
        form=next((log.form for log in logs if log.form != Form()), Form()),
        tolerances=tuple(dict.fromkeys(each for log in logs for each in log.tolerances or ())) or None,
        in_contact=all(log.in_contact for log in logs),
        timed=all(log.timed for log in logs),
    )


def _shifted(event: Event, samples: int) -> Event:
    if "first" not in event.data or event.kind != "move":
        return event
    return replace(event, data=event.data | {"first": event.data["first"] + samples})


def _name(log: Log) -> str:
    return ", ".join(log.sources) or "a log"


@dataclass(frozen=True)
class Stop:
    """An exploration that ended before all was done.

    Args:
        cause: why, in a few words.
        sweeps: of the survey that were made.
        planned: sweeps that the survey wanted; None: it was not known yet.
        incomplete: False if the survey is whole, and the time that the scene allows ended what came after it.
    """

    cause: str
    sweeps: int
    planned: int | None
    incomplete: bool = True

    @property
    def text(self) -> str:
        """The same in words: "stopped after 3 of 15 sweeps: ..."."""
        if self.planned is not None and self.sweeps >= self.planned:
            return f"stopped after the {self.planned} sweeps of the survey, in what followed it: {self.cause}"
        if self.planned is None:
            return f"stopped after {count_text(self.sweeps, 'sweep')}, before the survey was planned: {self.cause}"
        return f"stopped after {self.sweeps} of {count_text(self.planned, 'sweep')}: {self.cause}"


# Of a log's metadata: an exploration, which ends with an outcome; other logs (reprobe's, a program's own) have none
EXPLORATION = {"job": "run"}
# Kinds of events: how many sweeps the survey has, and why the exploration ended
SURVEY, OUTCOME = "survey", "outcome"


def stop_of(log: Log) -> Stop | None:
    """Why the exploration of a log ended early, None if it did not, or is none of ours."""
    if log.metadata.get("job") != EXPLORATION["job"]:
        return None
    outcome = next((event.data for event in reversed(log.events) if event.kind == OUTCOME), {})
    survey = next((event.data for event in reversed(log.events) if event.kind == SURVEY), {})
    made = sum(event.kind == "move" and event.data["purpose"] == "sweep" for event in log.events)
    planned = None if not survey else int(survey["sweeps"])
    sweeps = int(outcome.get("sweeps", made - int(survey.get("before", 0))))
    sweeps = sweeps if planned is None else min(sweeps, planned)
    if not outcome:
        return Stop("the program was killed, the machine lost its power, or the disk was full", sweeps, planned)
    if outcome.get("finished"):
        return Stop(str(outcome["cause"]), sweeps, planned, False) if outcome["reason"] == "budget" else None
    return Stop(str(outcome.get("cause") or outcome.get("detail") or outcome["reason"]), sweeps, planned)


Held = TypeVar("Held")  # what an event holds

KIND = "base"


def base_event(base: Base) -> dict[str, Any]:
    """JSON values that `read_base` turns back into the same base, bit for bit."""
    return {
        "kind": base.kind,
        "parameters": base.record(),
        "vertices": base.surface.vertices.tolist(),
        "faces": base.surface.faces.tolist(),
    }


def read_base(events: Sequence[Event]) -> Base | None:
    """The last base that the events hold, None if none does.

    Raises:
        UserError: a base event that is not one.
    """
    return _last(events, KIND, lambda of: Base.read(Surface(of["vertices"], of["faces"]), of["kind"], of["parameters"]))


# Kind of event: the noise of the samples, as who explored measured it on the way
NOISE = "noise"


def read_noise(events: Sequence[Event]) -> Noise | None:
    """The last noise that the events hold, None if none does.

    Raises:
        UserError: a noise event that is not one.
    """
    return _last(events, NOISE, Noise.read)


def _last(events: Sequence[Event], kind: str, read: Callable[[dict[str, Any]], Held]) -> Held | None:
    """What the last event of a kind holds, None if there is none."""
    for event in reversed(events):
        if event.kind == kind:
            try:
                return read(event.data)
            except (KeyError, TypeError, SurfaceError, NoiseError) as error:
                raise UserError(f"the log's {kind} event is not readable: {error}") from error
    return None
