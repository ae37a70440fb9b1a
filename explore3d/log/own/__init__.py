"""Our own logs: what was recorded, as it is held in memory and written to MCAP."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from explore3d.log.own.averaging import (
        SAMPLE_GAP as SAMPLE_GAP,
        about_averaging as about_averaging,
        averaged_file as averaged_file,
        averaged_log as averaged_log,
        averaging_words as averaging_words,
        lone_steps as lone_steps,
        step_lengths as step_lengths,
        unit_vectors as unit_vectors,
        usual_step as usual_step,
    )
    from explore3d.log.own.chunks import Damage as Damage, intact_chunks as intact_chunks
    from explore3d.log.own.format import FRAME as FRAME, LOG as LOG, MAGIC as MAGIC, VERSION as VERSION
    from explore3d.log.own.memory import must_fit as must_fit, must_fit_analysis as must_fit_analysis
    from explore3d.log.own.reader import digest as digest, iter_log as iter_log, read_log as read_log
    from explore3d.log.own.record import (
        EXPLORATION as EXPLORATION,
        KIND as KIND,
        NOISE as NOISE,
        OUTCOME as OUTCOME,
        SURVEY as SURVEY,
        Event as Event,
        Log as Log,
        Stop as Stop,
        base_event as base_event,
        merge as merge,
        move_event as move_event,
        read_base as read_base,
        read_noise as read_noise,
        stop_of as stop_of,
    )
    from explore3d.log.own.stream import (
        LogStream as LogStream,
        count_samples as count_samples,
        head as head,
        large_log as large_log,
    )
    from explore3d.log.own.tail import (
        LogTail as LogTail,
        Piece as Piece,
        is_whole as is_whole,
        need_log as need_log,
        newest_log as newest_log,
    )
    from explore3d.log.own.writer import LogWriter as LogWriter, Recorder as Recorder

_PUBLIC = {
    "averaging": (
        "SAMPLE_GAP",
        "about_averaging",
        "averaged_file",
        "averaged_log",
        "averaging_words",
        "lone_steps",
        "step_lengths",
        "unit_vectors",
        "usual_step",
    ),
    "chunks": ("Damage", "intact_chunks"),
    "format": ("FRAME", "LOG", "MAGIC", "VERSION"),
    "memory": ("must_fit", "must_fit_analysis"),
    "reader": ("digest", "iter_log", "read_log"),
    "record": (
        "EXPLORATION",
        "Event",
        "KIND",
        "Log",
        "NOISE",
        "OUTCOME",
        "SURVEY",
        "Stop",
        "base_event",
        "merge",
        "move_event",
        "read_base",
        "read_noise",
        "stop_of",
    ),
    "stream": ("LogStream", "count_samples", "head", "large_log"),
    "tail": ("LogTail", "Piece", "is_whole", "need_log", "newest_log"),
    "writer": ("LogWriter", "Recorder"),
}
doorway(__name__, _PUBLIC)
