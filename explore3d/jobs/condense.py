"""Condense: a log too large for memory becomes its crossings, every sample near them, and a few of the rest.

Chunk after chunk is searched with the noise that it has; what came of a chunk is a file, so that an interrupted
analysis goes on where it stopped. Away from crossings every k-th sample stays, as it was recorded: the noise of a
sample stays what it is, there are only fewer of them.
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from explore3d import __version__
from explore3d.log import Event, LogStream, count_samples
from mapping import BoolArray, Trace
from mapping.base import Base
from mapping.detection import Crossing, Detections, detect
from mapping.geometry.mesh import write_whole
from mapping.inference.likelihood import samples_near
from mapping.instrument import Noise, Term

CHUNK = 2_000_000  # samples searched at once
KEPT_BACKGROUND_SAMPLES = 1_500_000  # samples kept away from crossings, about
CROSSING_REACH = 1.5  # tip radii around a crossing within which every sample is kept


@dataclass(frozen=True, eq=False)
class Condensed:
    """What is left of a chunk, or of a log.

    Args:
        trace: samples near crossings, and every k-th of the others.
        detections: of all samples; `start` and `stop` of its crossings count in `trace`.
        samples: how many there were.
        events, complete, recovered: of a whole log, as in explore3d.log.own.record.Log.
    """

    trace: Trace
    detections: Detections
    samples: int
    events: tuple[Event, ...] = ()
    complete: bool = True
    recovered: str = ""


def condense(
    stream: LogStream,
    base: Base,
    folder: Path | None,
    share: Callable[[float], None] = lambda _: None,
    chunk: int = CHUNK,
    **settings: Any,
) -> Condensed:
    """Search a log chunk by chunk.

    Args:
        stream: the log.
        base: the global model.
        folder: of the chunks' results, read instead of searching again; None keeps none.
        share: told the share done.
        chunk: samples searched at once.
        settings: of mapping.detection.detect.detect.
    """
    total = count_samples(stream.path)
    every = max(1, round(total / KEPT_BACKGROUND_SAMPLES))
    key = _key(stream.path, every, chunk, settings)
    result = None if folder is None else folder / "whole.npz"
    if result is not None and (earlier := _load(result, key)) is not None:
        return earlier
    parts: list[Condensed] = []
    done = 0
    for number, trace in enumerate(stream.sweeps(chunk)):
        file = None if folder is None else folder / f"chunk-{number:05d}.npz"
        part = _load(file, key) if file is not None else None
        if part is None:
            part = _condensed(trace, base, every, settings)
            if file is not None:
                _save(part, file, key)
        parts.append(part)
        done += part.samples
        share(min(1.0, done / max(total, 1)))
    whole = replace(joined(parts), events=stream.events, complete=stream.complete, recovered=stream.recovered)
    if result is not None:
        _save(whole, result, key)
    return whole


def joined(parts: list[Condensed]) -> Condensed:
    """The chunks as one; the noise is that of the chunk of median level, the limit the worst of all."""
    found = [part.detections for part in parts if np.isfinite(part.detections.threshold)] or [parts[0].detections]
    middle = sorted(found, key=lambda each: each.noise.sd)[len(found) // 2]
    together = replace(
        middle,
        crossings=tuple(crossing for part in parts for crossing in part.detections.crossings),
        detection_limit=max(each.detection_limit for each in found),
        inspected_length=sum(each.inspected_length for each in found),
        left_out=tuple(sentence for part in parts for sentence in part.detections.left_out),
        remarks=tuple(dict.fromkeys(remark for each in found for remark in each.remarks)),
    )
    trace = Trace.concatenate([part.trace for part in parts])
    return Condensed(trace, together, sum(part.samples for part in parts))


def _condensed(trace: Trace, base: Base, every: int, settings: dict[str, Any]) -> Condensed:
    found = detect(trace, base, **settings)
    keep, begins = _kept(trace, found.crossings, every), {}
    keep[list(found.unfelt)] = False
    bounds = np.flatnonzero(np.diff(trace.sweep, prepend=trace.sweep[0] - 1))
    for begin in bounds:
        begins[int(trace.sweep[begin])] = int(begin)
    index = np.flatnonzero(keep)

    def place(crossing: Crossing) -> Crossing:
        first = begins[crossing.sweep]
        own = np.searchsorted(index, [first, first + crossing.start, first + crossing.stop])
        return replace(crossing, start=int(own[1] - own[0]), stop=int(own[2] - own[0]))

    placed = replace(found, crossings=tuple(place(crossing) for crossing in found.crossings), unfelt=())
    return Condensed(trace.select(index), placed, len(trace))


def _kept(trace: Trace, crossings: tuple[Crossing, ...], every: int) -> BoolArray:
    """(N,) every k-th sample, and all within reach of a crossing, of its own sweep or another."""
    keep = np.zeros(len(trace), dtype=bool)
    keep[::every] = True
    ends = np.flatnonzero(np.diff(trace.sweep)) + 1
    keep[np.concatenate([[0], ends, ends - 1, [len(trace) - 1]])] = True
    if crossings:
        points = np.array([crossing.point + trace.tip_radius * crossing.normal for crossing in crossings])
        reach = CROSSING_REACH * trace.tip_radius + max(crossing.half_width for crossing in crossings)
        keep[samples_near(trace, points, reach)] = True
    return keep


def _key(path: Path, every: int, chunk: int, settings: dict[str, Any]) -> str:
    state = path.stat()
    log = [str(path.resolve()), state.st_size, state.st_mtime_ns]
    return json.dumps([__version__, *log, every, chunk, repr(settings)])


def _save(part: Condensed, file: Path, key: str) -> None:
    values = {each.name: getattr(part.trace, each.name) for each in fields(Trace)}
    arrays: dict[str, Any] = {name: value for name, value in values.items() if isinstance(value, np.ndarray)}
    numbers = {name: value for name, value in values.items() if isinstance(value, float)}
    record = asdict(part.detections) | {"samples": part.samples, "key": key, "trace": numbers}
    record["log"] = {"complete": part.complete, "recovered": part.recovered}
    record["events"] = [asdict(event) for event in part.events]
    text = json.dumps(record, default=lambda array: array.tolist())
    stream = io.BytesIO()
    np.savez(stream, record=np.frombuffer(text.encode(), dtype=np.uint8), **arrays)
    file.parent.mkdir(parents=True, exist_ok=True)
    write_whole(file, stream.getvalue())


def _load(file: Path, key: str) -> Condensed | None:
    """An earlier result; None if there is none, or it is of another log or other settings."""
    if not file.is_file():
        return None
    with np.load(file, allow_pickle=False) as arrays:
        record = json.loads(arrays["record"].tobytes())
        if record.pop("key") != key:
            return None
        trace = Trace(**record.pop("trace"), **{name: arrays[name] for name in arrays.files if name != "record"})
    samples, log = record.pop("samples"), record.pop("log", {})
    events = tuple(Event(**event) for event in record.pop("events", []))
    vectors = ("point", "normal", "tangent")
    crossings = tuple(
        Crossing(**(each | {name: np.array(each[name]) for name in vectors})) for each in record.pop("crossings")
    )
    told = record.pop("noise")
    noise = Noise(**(told | {"further": tuple(Term(**term) for term in told.get("further", ()))}))
    for name in ("left_out", "remarks", "unfelt"):
        record[name] = tuple(record.get(name, ()))
    record["inspected_sweeps"] = tuple((number, length) for number, length in record.get("inspected_sweeps", ()))
    detections = Detections(crossings=crossings, noise=noise, **record)
    return Condensed(trace, detections, samples, events, **log)
