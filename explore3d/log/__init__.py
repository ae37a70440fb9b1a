"""Logs: what was recorded, in MCAP or in tables."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from explore3d.log.format import LOG as LOG
    from explore3d.log.inspect import Inspection as Inspection, inspect as inspect
    from explore3d.log.load import load_logs as load_logs
    from explore3d.log.reader import digest as digest, iter_log as iter_log, read_log as read_log
    from explore3d.log.record import (
        KIND as KIND,
        Event as Event,
        Log as Log,
        base_event as base_event,
        read_base as read_base,
    )
    from explore3d.log.stream import (
        LogStream as LogStream,
        count_samples as count_samples,
        head as head,
        large_log as large_log,
    )
    from explore3d.log.writer import LogWriter as LogWriter, Recorder as Recorder

_PUBLIC = {
    "format": ("LOG",),
    "inspect": ("Inspection", "inspect"),
    "load": ("load_logs",),
    "reader": ("digest", "iter_log", "read_log"),
    "record": ("Event", "KIND", "Log", "base_event", "read_base"),
    "stream": ("LogStream", "count_samples", "head", "large_log"),
    "writer": ("LogWriter", "Recorder"),
}
doorway(__name__, _PUBLIC)
