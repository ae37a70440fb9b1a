"""LogTail: a log that is still being written, or one from years ago, in pieces as they come."""

from __future__ import annotations

import os
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from explore3d import UserError
from explore3d.log.own.format import LOG, MAGIC
from explore3d.log.own.reader import CHANNEL_TOPICS, Reading, take_checked
from explore3d.log.own.record import Event


@dataclass(frozen=True, eq=False)
class Piece:
    """Samples that came since the last look, in their order.

    Args:
        samples: (N,) structured as in the log: x, y, z (m), t (s), sweep, and what else the finger felt.
        move: the move that gave them, None where none was recorded.
        under_way: True of a move that is not over: the same samples come again when it is.
    """

    samples: NDArray[np.void]
    move: Event | None
    under_way: bool = False


class LogTail:
    """Reads what a log has grown by since it was last asked; the file is open during a look only.

    A chunk that is half written is left for the next look; a damaged one is passed over (`read_log` says so, this does
    not). A file that was moved is found again by whoever gives its new `path`; another file in its place begins anew.

    Args:
        path: the log.
        tip_radius: m; needed only for a log whose beginning is destroyed.
    """

    def __init__(self, path: Path | str, tip_radius: float | None = None) -> None:
        self.path = Path(path)
        self._told = tip_radius
        self._begin()

    def _begin(self) -> None:
        self.reading = Reading(self.path, self._told, events=[])
        self._topics = dict(CHANNEL_TOPICS)
        self._at, self._seen, self._file = 0, 0, (0, 0)

    def look(self) -> tuple[list[Piece], list[Event], bool]:
        """What is new: samples, events, and True if the log in this place is another one than before.

        Raises:
            UserError: not a log of ours.
            FileNotFoundError: it is not there, or not there any more.
        """
        from mcap.records import Channel, Message

        from explore3d.log.own.chunks import Damage, intact_chunks

        batches: list[tuple[Event | None, list[NDArray[np.void]]]] = []
        with self.path.open("rb") as file:
            status = os.fstat(file.fileno())
            anew = (status.st_dev, status.st_ino) != self._file or status.st_size < self._at
            if anew:
                need_log(self.path)
                self._begin()
                self._file = (status.st_dev, status.st_ino)
            if status.st_size == self._at:
                return [], [], anew
            damage = Damage(end=self._at)
            for records in intact_chunks(file, damage, self._at):
                for record in records:
                    if isinstance(record, Channel):
                        self._topics[record.id] = record.topic
                    elif isinstance(record, Message):
                        self._take(self._topics.get(record.channel_id, ""), record, batches)
            self._at = damage.end
        events = list(self.reading.events or ())[self._seen :]
        self._seen += len(events)
        pieces = [Piece(_joined(parts), move) for move, parts in batches]
        return [*pieces, *self._under_way()], events, anew

    def _take(self, topic: str, message: Any, batches: list[tuple[Event | None, list[NDArray[np.void]]]]) -> None:
        """Note an event, or add samples to those of the same move."""
        batch = take_checked(topic, message, self.reading)
        if batch is None:
            return
        move = self._last_move()
        if not batches or batches[-1][0] is not move or batches[-1][1][0].dtype != batch.dtype:
            batches.append((move, []))
        batches[-1][1].append(batch)

    def _last_move(self) -> Event | None:
        for event in reversed(self.reading.events or ()):
            if event.kind == "move":
                return event
        return None

    def _under_way(self) -> list[Piece]:
        return [Piece(_joined(self.reading.felt), None, under_way=True)] if self.reading.felt else []

    @property
    def closed(self) -> bool:
        """True if the log has its end: nothing more will come."""
        return self.reading.closed

    @property
    def tip_radius(self) -> float | None:
        """As the log states it, m; None as long as its start was not met."""
        return self.reading.tip_radius

    @property
    def title(self) -> str:
        """The title of the log's scene, "" if it has none."""
        try:
            return str(tomllib.loads(str(self.reading.start.get("scene", ""))).get("title", ""))
        except tomllib.TOMLDecodeError:
            return ""


def _joined(parts: list[NDArray[np.void]]) -> NDArray[np.void]:
    """Batches of one layout after one another, read-only; numpy's own way compares every field of every batch."""
    return np.frombuffer(b"".join(part.data for part in parts), parts[0].dtype)


def need_log(path: Path) -> None:
    """A log has to begin as MCAP files do, however little of it is there yet, or to hold an intact piece of one.

    Raises:
        UserError: the file is something else.
    """
    from explore3d.log.own.chunks import Damage, intact_chunks

    with path.open("rb") as file:
        if MAGIC.startswith(file.read(len(MAGIC))):
            return
        if next(intact_chunks(file, Damage()), None) is None:
            raise UserError(f"{path}: is no log: it does not begin as one does, and holds no intact piece of one")


def newest_log(folder: Path) -> Path | None:
    """The log of a session's folder that was written last: its own, or that of one that grows beside it."""
    found = [*folder.glob(LOG), *folder.glob(f".part-{LOG}"), *folder.glob(f"unfinished-*/{LOG}")]
    return max(found, key=lambda path: path.stat().st_mtime_ns, default=None)


def is_whole(path: Path) -> bool:
    """True if a log was closed: it ends as MCAP files do."""
    with path.open("rb") as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(max(0, size - len(MAGIC)))
        return file.read() == MAGIC
