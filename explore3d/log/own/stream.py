"""LogStream: a log too large for memory, sweep after sweep, with everything else that it holds."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from explore3d import UserError
from explore3d.log.own.format import LOG, SAMPLES_PER_MESSAGE, TRACE_TOPIC
from explore3d.log.own.reader import Reading, _batches, _loss, _trace, is_log
from explore3d.log.own.record import Event
from mapping import Trace

# Bytes of a sample in a log with positions alone: only where the log was never closed, and cannot say how many it holds
BYTES = 16
# More samples than this are not loaded at once: the analysis of so many takes about 4 GB
MOST_LOADED_SAMPLES = 12_000_000


class LogStream:
    """A log's samples in pieces; iterate once. What is known besides grows while the samples pass by.

    Args:
        path: the log.
        tip_radius: m; needed only for a log whose beginning is destroyed.

    Raises:
        UserError: (while iterating) as explore3d.log.own.reader.read_log.
    """

    def __init__(self, path: Path | str, tip_radius: float | None = None) -> None:
        self.path = Path(path)
        self.reading = Reading(self.path, tip_radius, events=[])

    def sweeps(self, samples: int) -> Iterator[Trace]:
        """Traces of at least that many samples (the last one fewer), each of whole sweeps.

        A sweep that alone is four times as long is cut all the same: memory is bounded.
        """
        held: list[NDArray[np.void]] = []
        count, last = 0, None
        for batch in _batches(self.reading):
            before = batch["sweep"][0] if last is None else last
            ends, last = np.flatnonzero(np.diff(batch["sweep"], prepend=before)), batch["sweep"][-1]
            cut = len(batch) if count >= 4 * samples else int(ends[-1]) if len(ends) else None
            if count < samples or cut is None:
                held.append(batch)
                count += len(batch)
                continue
            yield _trace([each for each in (*held, batch[:cut]) if len(each)], self.reading)
            held = [batch[cut:]] if cut < len(batch) else []
            count = len(batch) - cut
        if count:
            yield _trace(held, self.reading)
        if not self.reading.samples:
            raise UserError(f"{self.path}: field samples: the log holds none{_loss(self.reading, ', ')}")

    @property
    def scene_text(self) -> str:
        """The scene's text, "" if none."""
        return str(self.reading.start.get("scene", ""))

    @property
    def events(self) -> tuple[Event, ...]:
        """What has been noted so far."""
        return tuple(self.reading.events or ())

    @property
    def complete(self) -> bool:
        """True once everything that the log promised was read."""
        return self.reading.complete

    @property
    def recovered(self) -> str:
        """One sentence on what is missing, once all was read."""
        return _loss(self.reading)


def head(path: Path | str) -> tuple[str, tuple[Event, ...]]:
    """Scene text and the events before the first sample."""
    stream = LogStream(path)
    for _ in stream.sweeps(1):
        break
    return stream.scene_text, stream.events


def count_samples(path: Path | str) -> int:
    """About how many samples a log holds, without reading them."""
    from mcap.exceptions import McapError
    from mcap.reader import make_reader

    try:
        with Path(path).open("rb") as file:
            summary = make_reader(file).get_summary()
            if summary is not None and summary.statistics is not None:
                counts = summary.statistics.channel_message_counts
                trace = [c.id for c in summary.channels.values() if c.topic == TRACE_TOPIC]
                return int(sum(counts.get(number, 0) for number in trace)) * SAMPLES_PER_MESSAGE
    except (McapError, ValueError, EOFError, OSError):  # a log that was never closed has no summary
        pass
    return Path(path).stat().st_size // BYTES


def large_log(path: Path | str) -> Path | None:
    """The log itself, or that in the folder of a session, if it is better streamed than loaded; else None."""
    file = Path(path) / LOG if Path(path).is_dir() else Path(path)
    if not file.is_file() or file.stat().st_size < MOST_LOADED_SAMPLES * BYTES // 4:  # the cheap test first
        return None
    return file if is_log(file) and count_samples(file) > MOST_LOADED_SAMPLES else None
