"""Recorder: a log writer that remembers what it wrote, so that a run's analysis need not read the log again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from explore3d import log_format
from explore3d.log import LogWriter
from explore3d.log_reader import Reading, as_log, note
from explore3d.recording import Log
from hw.moves import Move
from mapping.trace import Trace

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

    def recorded(self) -> Log:
        """What explore3d.log_reader.read_log would read from the closed file."""
        trace = Trace.concatenate(self._traces)
        resolution = float(self._reading.start["resolution"])
        stated = trace if trace.resolution == resolution else replace(trace, resolution=resolution)
        return as_log(stated, self._reading)

    def _add(self, name: str, log_time: int, data: bytes) -> None:
        super()._add(name, log_time, data)
        if name in _TOPICS:
            note(_TOPICS[name], data, self._reading)
