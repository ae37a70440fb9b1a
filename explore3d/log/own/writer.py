"""LogWriter: the append-only MCAP log of one exploration; whatever kills the program, the log opens.

Each `write` ends in a flush, so that a killed program loses nothing that `write` had returned from. Apart from
`started` the writer looks at no clock: the same samples and metadata give the same bytes. A Recorder also remembers
what it wrote, so that a run's analysis need not read the log again.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from explore3d import UserError
from explore3d.log.own import format as log_format, point_cloud
from explore3d.log.own.reader import Reading, as_log, note
from explore3d.log.own.record import Log, move_event
from hw import Move
from mapping import Trace

SYNC_PERIOD = 0.5  # s; longest time that written samples stay in the system's cache while writing goes on


class LogWriter:
    """Writes scene, moves, samples and events as they come; use it as a context manager.

    Args:
        path: the file to make; an existing one is never overwritten.
        tip_radius: radius of the fingertip, m: of every trace to come.
        scene_text: the scene file's text.
        metadata: versions, seed, what the finger is: JSON values.
        started: wall-clock time of t = 0, for a real finger; None for a simulated one.
        resolution: step of the positions, m (mapping.trace.Trace); 0: none.

    Raises:
        UserError: the file exists or cannot be made.
    """

    def __init__(
        self,
        path: Path | str,
        *,
        tip_radius: float,
        scene_text: str = "",
        metadata: Mapping[str, Any] | None = None,
        started: datetime | None = None,
        resolution: float = 0.0,
    ) -> None:
        from mcap.writer import Writer

        self.path = Path(path)
        self.samples = 0
        self._tip_radius = float(tip_radius)
        self._epoch = 0 if started is None else int(started.timestamp() * 1e9)
        self._t: float | None = None
        self._sequence = 0
        self._synced = time.monotonic()
        self._prefixes: dict[tuple[str, ...], tuple[np.dtype[np.void], bytes]] = {}
        with self._disk("make"):
            self._file = self.path.open("xb")
        self._mcap = Writer(self._file)
        self._mcap.start(profile="explore3d")
        self._register()
        notes = dict(metadata or {})
        self._start = {
            "schema": log_format.VERSION,
            "tip_radius": self._tip_radius,
            "resolution": float(resolution),
            "frame": log_format.FRAME,
            "started": None if started is None else started.isoformat(),
            "scene": scene_text,
            "metadata": notes,
        }
        # twice, and again at the end, each in a chunk of its own: no damage to one chunk takes the tip radius away
        for _ in range(2):
            self._message("start", self._start)
            self._flush()
        # the same again where tools look for it; the reader trusts the message, which a checksum covers
        self._mcap.add_attachment(0, self._epoch, "scene.toml", "application/toml", scene_text.encode())
        texts = {key: value if isinstance(value, str) else _json(value) for key, value in notes.items()}
        self._mcap.add_metadata("explore3d", texts | {"tip_radius": repr(self._tip_radius)})
        self._flush(sync=True)

    def _register(self) -> None:
        self._channels = {}
        for name, (topic, schema) in log_format.EVENTS.items():
            identifier = self._mcap.register_schema(json.loads(schema)["title"], "jsonschema", schema)
            self._channels[name] = self._mcap.register_channel(topic, "json", identifier)
        cloud = self._mcap.register_schema(point_cloud.SCHEMA_NAME, "protobuf", point_cloud.descriptor_set())
        self._channels["trace"] = self._mcap.register_channel(log_format.TRACE_TOPIC, "protobuf", cloud)
        path = self._mcap.register_schema("foxglove.PosesInFrame", "jsonschema", log_format.PATH_SCHEMA)
        self._channels["path"] = self._mcap.register_channel(log_format.PATH_TOPIC, "json", path)
        self._channels["felt"] = self._mcap.register_channel(log_format.FELT_TOPIC, "protobuf", cloud)

    def write(self, move: Move, trace: Trace) -> None:
        """Append a move and what it gave; when this returns, a kill cannot take it back.

        Raises:
            UserError: a trace of another tip radius, a sweep number beyond 32 bits, a full disk.
        """
        if len(trace) and trace.tip_radius != self._tip_radius:
            raise UserError(
                f"{self.path}: this log is of tip radius {self._tip_radius} m; found a trace of {trace.tip_radius} m"
            )
        if len(trace):
            self._t = float(trace.t[0])
        noted = move_event(move, self._t, self.samples, len(trace))
        self._message("move", {"t": noted.t, **noted.data})
        self._message("path", _poses(move, self._log_time(self._t)))
        # moves and samples lie in chunks of their own: who asks for the plan alone fetches no samples
        if len(trace):
            with self._disk("write"):
                self._mcap.flush()
        self._samples("trace", trace)
        self.samples += len(trace)
        if len(trace):
            self._t = float(trace.t[-1])
        self._flush()

    def felt(self, trace: Trace) -> None:
        """Append samples of a move that is still under way, in case that its end never comes.

        Readers take them only where no `write` follows, which holds the same samples.
        """
        self._samples("felt", trace)
        self._flush()

    def event(self, kind: str, data: Mapping[str, Any]) -> None:
        """Append a note of that kind; `data` holds JSON values (numpy arrays and numbers are converted)."""
        self._message("event", {"t": self._t, "kind": kind, "data": dict(data)})
        self._flush()

    def move_to(self, path: Path) -> None:
        """Put the file in another place on the same disk, replacing what is there; writing goes on.

        Raises:
            UserError: the disk does not take it.
        """
        if not self._file.closed:
            self._flush(sync=True)
        with self._disk("move"):
            os.replace(self.path, path)
        self.path = path

    def close(self, reason: str = "closed") -> None:
        """Write the end and the index; further calls do nothing."""
        if self._file.closed:
            return
        with self._disk("write"), self._file:
            self._message("start", self._start)
            self._mcap.flush()
            self._message("end", {"t": self._t, "samples": self.samples, "reason": reason})
            self._mcap.finish()
            self._flush(sync=True)

    def __enter__(self) -> LogWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        self.close("closed" if error is None else f"{type(error).__name__}: {error}")

    def _samples(self, channel: str, trace: Trace) -> None:
        optional = tuple(name for name in log_format.OPTIONAL_FIELDS if getattr(trace, name) is not None)
        dtype, prefix = self._layout(optional)
        samples = _pack(trace, dtype, optional, self.path)
        for start in range(0, len(samples), log_format.SAMPLES_PER_MESSAGE):
            batch = samples[start : start + log_format.SAMPLES_PER_MESSAGE]
            stamp = self._log_time(float(batch["t"][0]))
            self._add(channel, stamp, point_cloud.encode(batch, prefix, stamp))

    def _layout(self, optional: tuple[str, ...]) -> tuple[np.dtype[np.void], bytes]:
        if optional not in self._prefixes:
            dtype = log_format.sample_dtype(optional)
            self._prefixes[optional] = dtype, point_cloud.encode_prefix(dtype, log_format.FRAME)
        return self._prefixes[optional]

    def _log_time(self, t: float | None) -> int:
        # MCAP times are unsigned; the exact t of every sample is in the sample
        return min(max(0, self._epoch + round((t or 0.0) * 1e9)), 2**63 - 1)

    def _message(self, name: str, data: Mapping[str, Any]) -> None:
        self._add(name, self._log_time(self._t), _json(data).encode())

    def _add(self, name: str, log_time: int, data: bytes) -> None:
        if len(data) > log_format.LARGEST_RECORD // 2:
            raise UserError(f"{self.path}: a message of {len(data)} bytes is too large for the log")
        # one count over all channels: a gap in it tells the reader that something is missing
        with self._disk("write"):
            self._mcap.add_message(self._channels[name], log_time, data, log_time, self._sequence % 2**32)
        self._sequence += 1

    def _flush(self, sync: bool = False) -> None:
        with self._disk("write"):
            self._mcap.flush()
            if sync or time.monotonic() - self._synced > SYNC_PERIOD:
                os.fsync(self._file.fileno())
                self._synced = time.monotonic()

    @contextmanager
    def _disk(self, verb: str) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise UserError(f"{self.path}: cannot {verb} the log: {error.strerror}") from error


def _pack(trace: Trace, dtype: np.dtype[np.void], optional: tuple[str, ...], path: Path) -> NDArray[np.void]:
    if len(trace) and (trace.sweep.max() >= 2**31 or trace.sweep.min() < -(2**31)):
        raise UserError(f"{path}: field sweep must fit 32 bits; found {trace.sweep.min()} to {trace.sweep.max()}")
    samples = np.empty(len(trace), dtype)
    samples["t"], samples["sweep"] = trace.t, trace.sweep
    groups = {"centers": ("x", "y", "z")} | {name: log_format.OPTIONAL_FIELDS[name] for name in optional}
    for group, names in groups.items():
        for axis, name in enumerate(names):
            samples[name] = getattr(trace, group)[:, axis]
    return samples


def _poses(move: Move, time_ns: int) -> dict[str, Any]:
    """The move as foxglove.PosesInFrame; viewers draw a pose along its x, so x is turned to the pressing direction."""
    # half-way quaternion (x, y, z, w) from x to the direction; straight back it is half a turn about z
    a, b, c = move.approach.T
    turns = np.column_stack([np.zeros_like(a), -c, b, 1.0 + a])
    turns[np.linalg.norm(turns, axis=1) < 1e-9] = (0.0, 0.0, 1.0, 0.0)
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    poses = [
        {
            "position": dict(zip("xyz", point, strict=True)),
            "orientation": dict(zip("xyzw", turn, strict=True)),
        }
        for point, turn in zip(move.path.tolist(), turns.tolist(), strict=True)
    ]
    seconds, nanos = divmod(time_ns, 1_000_000_000)
    return {"timestamp": {"sec": seconds, "nsec": nanos}, "frame_id": log_format.FRAME, "poses": poses}


def _json(data: Any) -> str:
    def plain(value: Any) -> Any:
        if isinstance(value, np.ndarray | np.generic):
            return value.tolist()
        raise TypeError(f"a log keeps JSON values; found {type(value).__name__}: {value!r}")

    return json.dumps(data, default=plain, allow_nan=False)


_TOPICS = {name: topic for name, (topic, _) in log_format.EVENTS.items()}


class Recorder(LogWriter):
    """Writes like a LogWriter; what it wrote is held in memory as well."""

    def __init__(self, path: Path | str, **settings: Any) -> None:
        self._reading = Reading(Path(path), None, events=[])
        self._traces: list[Trace] = []
        super().__init__(path, **settings)

    def write(self, move: Move, trace: Trace) -> None:
        """Append a move and what it gave, as LogWriter.write does."""
        super().write(move, trace)
        if len(trace):
            self._traces.append(trace)
            self._reading.samples += len(trace)

    def move_to(self, path: Path) -> None:
        """Put the file in another place, as LogWriter.move_to does."""
        super().move_to(path)
        self._reading.path = path

    def recorded(self) -> Log:
        """What explore3d.log.own.reader.read_log would read from the closed file; the parts are let go of, for they
        would stay beside the whole for as long as the session does."""
        trace = Trace.concatenate(self._traces)
        self._traces = [trace]
        resolution = float(self._reading.start["resolution"])
        stated = trace if trace.resolution == resolution else replace(trace, resolution=resolution)
        return as_log(stated, self._reading)

    def _add(self, name: str, log_time: int, data: bytes) -> None:
        super()._add(name, log_time, data)
        if name in _TOPICS:
            note(_TOPICS[name], data, self._reading)
