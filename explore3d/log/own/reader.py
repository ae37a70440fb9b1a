"""Reading our logs, whole or damaged: all at once (`read_log`) or in batches of bounded memory (`iter_log`)."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from explore3d import EmptyLogError, UserError, count_text
from explore3d.log.own import format as log_format, point_cloud
from explore3d.log.own.record import Event, Log, merge
from mapping import FloatArray, Trace, TraceError

# fixed by LogWriter; needed only where the chunk that states them is damaged
CHANNEL_TOPICS = {i: topic for i, (topic, _) in enumerate(log_format.EVENTS.values(), 1)}
CHANNEL_TOPICS |= dict(
    enumerate((log_format.TRACE_TOPIC, log_format.PATH_TOPIC, log_format.FELT_TOPIC), len(CHANNEL_TOPICS) + 1)
)


@dataclass
class Reading:
    """What has been learnt of a log while its samples pass by."""

    path: Path
    tip_radius: float | None
    start: dict[str, Any] = field(default_factory=dict)
    events: list[Event] | None = None
    moves: int = 0
    samples: int = 0
    felt: list[NDArray[np.void]] = field(default_factory=list)
    before: int = 0  # samples before those of the last move
    announced: int = 0  # samples of the last move
    last: float = 0.0  # time of the last sample, s
    promised: int = 0
    messages: int = 0
    missing: int = 0
    damaged: int = 0
    cut: bool = False
    closed: bool = False

    @property
    def complete(self) -> bool:
        return self.closed and not (self.missing or self.promised > self.samples)


def is_log(path: Path | str) -> bool:
    """True if the file begins as MCAP files do.

    Raises:
        UserError: the file cannot be read.
    """
    return _read_start(Path(path)) == log_format.MAGIC


def read_log(path: Path | str | Sequence[Path | str], tip_radius: float | None = None) -> Log:
    """A whole log, or several as one; of a killed or damaged one all that is intact.

    Args:
        path: the file, or several of one object and one fingertip.
        tip_radius: m; needed only for a log whose beginning is destroyed; must agree with what the log states.

    Raises:
        UserError: no such file, not a log of ours, no intact sample, a tip radius that differs.
    """
    if not isinstance(path, str | Path):
        return merge([read_log(one, tip_radius) for one in path])
    reading = Reading(Path(path), tip_radius, events=[])
    batches = list(_batches(reading))
    if not batches:
        raise EmptyLogError(f"{path}: field samples: the log holds none{_loss(reading, ', ')}")
    return as_log(_trace(batches, reading), reading)


def as_log(trace: Trace, reading: Reading) -> Log:
    """All samples of a file, and what was noted while they passed by, as a Log."""
    metadata = dict(reading.start.get("metadata", {}))
    return Log(
        trace=trace,
        scene_text=reading.start.get("scene", ""),
        events=tuple(reading.events or ()),
        metadata=metadata | {"started": reading.start.get("started")},
        complete=reading.complete,
        recovered=_loss(reading),
        sha256=digest(reading.path),
        sources=(str(reading.path),),
    )


def digest(path: Path | str) -> str:
    """The file's SHA-256."""
    with Path(path).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def iter_log(path: Path | str, samples: int = 100_000, tip_radius: float | None = None) -> Iterator[Trace]:
    """The same samples in traces of about that many, for logs too large for memory.

    Raises:
        UserError: as `read_log`, when the first trace is asked for.
    """
    reading = Reading(Path(path), tip_radius)
    batches: list[NDArray[np.void]] = []
    given = 0
    for batch in _batches(reading):
        batches.append(batch)
        if reading.samples - given >= samples:
            yield _trace(batches, reading)
            batches, given = [], reading.samples
    if batches:
        yield _trace(batches, reading)
    if not reading.samples:
        raise EmptyLogError(f"{path}: field samples: the log holds none{_loss(reading, ', ')}")


def _batches(reading: Reading) -> Iterator[NDArray[np.void]]:
    """The messages' samples in order; everything else that is met is noted in `reading`."""
    from mcap.records import Channel, Message

    from explore3d.log.own.chunks import Damage, intact_chunks

    damage, topics, none = Damage(), dict(CHANNEL_TOPICS), True
    begins = is_log(reading.path)
    with reading.path.open("rb") as file:
        for records in intact_chunks(file, damage):
            for record in records:
                if isinstance(record, Channel):
                    topics[record.id] = record.topic
                elif isinstance(record, Message):
                    none = False
                    batch = take_checked(topics.get(record.channel_id, ""), record, reading)
                    if batch is not None:
                        yield batch
    reading.damaged, reading.cut = damage.damaged, damage.cut
    if reading.felt:  # of a move whose end never came, or whose samples did not all reach the disk
        felt = np.concatenate(reading.felt)
        rest = felt if reading.samples == reading.before else felt[felt["t"] > reading.last]
        reading.felt = [rest]
        reading.samples += len(rest)
        if len(rest):
            yield rest
    if none:
        why = "" if begins else "does not begin as an MCAP log does and "
        raise UserError(f"{reading.path}: {why}holds no intact message of an explore3d log; nothing can be recovered")


def take_checked(topic: str, message: Any, reading: Reading) -> NDArray[np.void] | None:
    try:
        return _take(topic, message, reading)
    except UserError:
        raise
    except (KeyError, ValueError, TypeError) as error:
        raise UserError(f"{reading.path}: message on {topic!r} is not of an explore3d log: {error!r}") from error


def _take(topic: str, message: Any, reading: Reading) -> NDArray[np.void] | None:
    """Note an event, or return the samples of a batch."""
    if not reading.start and topic != "/start":
        if reading.tip_radius is None:
            _seek_start(reading)
        _need_start(reading)
    reading.missing += max(0, message.sequence - reading.messages)
    reading.messages = message.sequence + 1
    if topic == log_format.TRACE_TOPIC:
        batch = point_cloud.decode(message.data)
        reading.samples += len(batch)
        reading.last = float(batch["t"][-1]) if len(batch) else reading.last
        if reading.samples >= reading.before + reading.announced:
            reading.felt.clear()
        return batch
    if topic == log_format.FELT_TOPIC:
        if reading.announced:  # the first since a move, to which what was felt before belongs
            reading.felt.clear()
            reading.announced, reading.before = 0, reading.samples
        reading.felt.append(point_cloud.decode(message.data))
        return None
    if topic in CHANNEL_TOPICS.values() and topic != log_format.PATH_TOPIC:
        note(topic, message.data, reading)
    return None


def note(topic: str, message: bytes, reading: Reading) -> None:
    """Take down what a message besides the samples says."""
    data = json.loads(message)
    if topic == "/start":
        _begin(data, reading)
    elif topic == "/move":
        reading.promised = max(reading.promised, data["first"] + data["samples"])
        reading.moves += 1
        reading.announced = data["samples"]
        reading.before = reading.samples
        if not reading.announced:
            reading.felt.clear()
        _keep(reading, Event("move", data.pop("t"), data))
    elif topic == "/event":
        _keep(reading, Event(data["kind"], data["t"], data["data"]))
    elif topic == "/end":
        reading.closed = True
        reading.promised = max(reading.promised, data["samples"])


def _keep(reading: Reading, event: Event) -> None:
    if reading.events is not None:
        reading.events.append(event)


def _begin(data: dict[str, Any], reading: Reading) -> None:
    if data.get("schema") != log_format.VERSION:
        raise UserError(
            f"{reading.path}: field schema is {data.get('schema')!r}; this version reads {log_format.VERSION!r}"
        )
    stated = float(data["tip_radius"])
    if not stated > 0.0:
        raise UserError(f"{reading.path}: field tip_radius is {stated:g} m; a fingertip's is greater than 0")
    if reading.tip_radius not in (None, stated):
        raise UserError(
            f"{reading.path}: field tip_radius: {reading.tip_radius:g} m is asked for, but the log states {stated:g} m"
        )
    reading.start, reading.tip_radius = data, stated


def _seek_start(reading: Reading) -> None:
    """Take a /start from further on, where the first ones are destroyed."""
    from mcap.records import Channel, Message

    from explore3d.log.own.chunks import Damage, intact_chunks

    topics = dict(CHANNEL_TOPICS)
    with reading.path.open("rb") as file:
        for records in intact_chunks(file, Damage()):
            for record in records:
                if isinstance(record, Channel):
                    topics[record.id] = record.topic
                elif isinstance(record, Message) and topics.get(record.channel_id) == "/start":
                    _begin(json.loads(record.data), reading)
                    return


def _need_start(reading: Reading) -> None:
    if reading.tip_radius is None:
        raise UserError(
            f"{reading.path}: field tip_radius: every message of the log that states it is destroyed (or this is "
            'no explore3d log); give it with --tip-radius, for example --tip-radius "10 mm"'
        )


def _trace(batches: list[NDArray[np.void]], reading: Reading) -> Trace:
    def column(names: Sequence[str]) -> FloatArray:
        values, begin = np.empty((sum(map(len, batches)), len(names))), 0
        for batch in batches:
            for axis, name in enumerate(names):
                values[begin : begin + len(batch), axis] = batch[name]
            begin += len(batch)
        return values

    optional = {
        group: column(names)
        for group, names in log_format.OPTIONAL_FIELDS.items()
        if all(names[0] in (batch.dtype.names or ()) for batch in batches)
    }
    assert reading.tip_radius is not None
    try:
        t, sweep = column(["t"])[:, 0], np.concatenate([batch["sweep"] for batch in batches])
        resolution = float(reading.start.get("resolution", 0.0))
        trace = Trace(t, column("xyz"), sweep, reading.tip_radius, **optional, resolution=resolution)
    except TraceError as error:
        raise UserError(f"{reading.path}: {error}") from error
    if back := trace.backwards():
        raise UserError(f"{reading.path}: field t: within a sweep times must not decrease; found that {back}")
    return trace


def _loss(reading: Reading, prefix: str = "") -> str:
    """One sentence on what is missing, "" if nothing is."""
    if reading.complete:
        return ""
    felt = sum(map(len, reading.felt))
    parts = [f"recovered {count_text(reading.samples, 'sample')} of {count_text(reading.moves, 'move')}"]
    parts += [f"{felt} of them of a move that was broken off"] if felt else []
    lost = reading.promised - reading.samples
    if lost > 0:
        are = "is" if lost == 1 else "are"
        parts.append(f"{count_text(lost, 'further sample')} that the log announces {are} lost")
    if reading.missing and lost <= 0:
        parts.append(f"{count_text(reading.missing, 'message')} {'is' if reading.missing == 1 else 'are'} missing")
    if reading.damaged:
        was = "was" if reading.damaged == 1 else "were"
        parts.append(f"{count_text(reading.damaged, 'damaged chunk')} {was} left out")
    if not reading.closed:
        cut = "in the middle of a chunk" if reading.cut else "after a whole chunk"
        parts.append(f"the log was never closed and ends {cut} (the program was killed, or the file was cut)")
    return prefix + "; ".join(parts)


def _read_start(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(8)
    except OSError as error:
        raise UserError(f"{path}: cannot read it: {error.strerror}") from error
