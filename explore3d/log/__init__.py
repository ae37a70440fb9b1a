"""Logs: what was recorded, in files of our own, in tables, or in those of other programs."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from explore3d.log.inspect import Inspection as Inspection, inspect as inspect
    from explore3d.log.load import load_logs as load_logs
    from explore3d.log.own import (
        EXPLORATION as EXPLORATION,
        FRAME as FRAME,
        KIND as KIND,
        LOG as LOG,
        MAGIC as MAGIC,
        NOISE as NOISE,
        OUTCOME as OUTCOME,
        SURVEY as SURVEY,
        VERSION as VERSION,
        Damage as Damage,
        Event as Event,
        Log as Log,
        LogStream as LogStream,
        LogTail as LogTail,
        LogWriter as LogWriter,
        Piece as Piece,
        Recorder as Recorder,
        Stop as Stop,
        base_event as base_event,
        count_samples as count_samples,
        digest as digest,
        head as head,
        intact_chunks as intact_chunks,
        is_whole as is_whole,
        iter_log as iter_log,
        large_log as large_log,
        move_event as move_event,
        must_fit_analysis as must_fit_analysis,
        need_log as need_log,
        newest_log as newest_log,
        read_base as read_base,
        read_log as read_log,
        read_noise as read_noise,
        stop_of as stop_of,
    )
    from explore3d.log.table import sidecar_of as sidecar_of

_PUBLIC = {
    "inspect": ("Inspection", "inspect"),
    "load": ("load_logs",),
    "own": (
        "LogTail",
        "Piece",
        "is_whole",
        "need_log",
        "newest_log",
        "Damage",
        "FRAME",
        "MAGIC",
        "VERSION",
        "intact_chunks",
        "EXPLORATION",
        "Event",
        "KIND",
        "LOG",
        "Log",
        "LogStream",
        "LogWriter",
        "NOISE",
        "OUTCOME",
        "Recorder",
        "SURVEY",
        "Stop",
        "base_event",
        "count_samples",
        "digest",
        "head",
        "iter_log",
        "large_log",
        "move_event",
        "must_fit_analysis",
        "read_base",
        "read_log",
        "read_noise",
        "stop_of",
    ),
    "table": ("sidecar_of",),
}
doorway(__name__, _PUBLIC)
