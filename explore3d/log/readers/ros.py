"""Readers of what robots record: bags of ROS 1 and 2, and the MCAP files of other programs (CDR or JSON)."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from explore3d import UserError
from explore3d.log.own import Log
from explore3d.log.readers.arrays import numbers_log
from explore3d.log.readers.optional import claimed, decoding, library
from explore3d.log.readers.own import POINT, TIP, of_others
from explore3d.log.readers.ros_messages import Felt, known, of_json, of_ros

_UNSAID = (TIP, POINT, "which point of the tool a pose is of (taken as the ball's centre)")
# (topic, type of its messages, message, time of its recording in ns)
Message = tuple[str, str, Any, int]


@dataclass
class Track:
    """What one source of positions gave.

    Args:
        frames: frames of its messages.
        times: s, one for each message.
        points: (K, 3) of each message.
        sweeps: True if each message is a whole sweep (a cloud).
        metres: False if nothing says in which unit.
    """

    frames: set[str] = field(default_factory=set)
    times: list[float] = field(default_factory=list)
    points: list[np.ndarray] = field(default_factory=list)
    sweeps: bool = False
    metres: bool = True


class RosBag:
    """Bags of ROS 1 (.bag) and of ROS 2 in SQLite (.db3)."""

    name = "a ROS bag"
    unsaid: tuple[str, ...] = _UNSAID

    def sniff(self, first: bytes) -> float:
        return 1.0 if first.startswith((b"#ROSBAG V2.0", b"SQLite format 3\0")) else 0.0

    def read(self, path: Path, settings: Mapping[str, Any]) -> Log:
        with path.open("rb") as file:
            one = file.read(7) == b"#ROSBAG"
        if not one:
            _is_bag(path)
        highlevel = library(path, "rosbags.highlevel", "ros", self.name)
        typesys = library(path, "rosbags.typesys", "ros", self.name)
        with TemporaryDirectory(prefix="explore3d-") as folder, decoding(path, self.name):
            # the library goes by the suffix
            link = Path(folder) / ("recording.bag" if one else "recording.db3")
            link.symlink_to(path.resolve())
            default = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
            with highlevel.AnyReader([link], default_typestore=default) as bag:
                wanted = [each for each in bag.connections if known(each.msgtype)]
                messages = (
                    (each.topic, each.msgtype, bag.deserialize(raw, each.msgtype), stamp)
                    for each, stamp, raw in (bag.messages(wanted) if wanted else ())
                )
                tracks, forces = _tracks(messages, of_ros)
        return _log(path, self.name, tracks, forces, settings)


def _is_bag(path: Path) -> None:
    """Refuse a database of something else, by its tables."""
    try:
        with closing(sqlite3.connect(f"file:{path.resolve()}?mode=ro&immutable=1", uri=True)) as base:
            tables = {name for (name,) in base.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
    except (sqlite3.Error, ValueError) as error:
        raise UserError(f"{path}: is a damaged SQLite database: {error}") from error
    if not {"topics", "messages"} <= tables:
        raise UserError(f"{path}: is an SQLite database without the tables topics and messages of a ROS bag")


class OtherMcap:
    """MCAP files of other programs: messages of ROS 2 in CDR, or in JSON."""

    name = "an MCAP file of another program"
    unsaid: tuple[str, ...] = _UNSAID

    def sniff(self, first: bytes) -> float:
        return 1.0 if of_others(first) else 0.0

    def read(self, path: Path, settings: Mapping[str, Any]) -> Log:
        from mcap.reader import make_reader

        with decoding(path, self.name), path.open("rb") as file:
            reader = make_reader(file, validate_crcs=True)
            summary = reader.get_summary()
            if summary is None:
                raise UserError(f"{path}: is {self.name} without an index, damaged or cut; `mcap recover` mends it")
            for chunk in summary.chunk_indexes:
                claimed(path, self.name, chunk.uncompressed_size, chunk.compressed_size)
            types = {each.id: each.name for each in summary.schemas.values()}
            encodings = {
                each.message_encoding
                for each in summary.channels.values()
                if each.message_encoding == "json" or known(types.get(each.schema_id, ""))
            }
            if len(encodings) != 1 or not encodings <= {"cdr", "json"}:
                found = ", ".join(
                    sorted({f"{each.topic} ({each.message_encoding})" for each in summary.channels.values()})
                )
                raise UserError(f"{path}: expected positions in CDR or in JSON; found topics {found[:120] or 'none'}")
            messages = _cdr(path, reader) if encodings == {"cdr"} else _json(reader)
            tracks, forces = _tracks(messages, of_ros if encodings == {"cdr"} else of_json)
        return _log(path, self.name, tracks, forces, settings)


def _cdr(path: Path, reader: Any) -> Iterator[Message]:
    typesys = library(path, "rosbags.typesys", "ros", "a ROS bag")
    store, seen = typesys.get_typestore(typesys.Stores.EMPTY), set()
    for schema, channel, message in reader.iter_messages():
        if schema is None or not known(schema.name) or channel.message_encoding != "cdr":
            continue
        if schema.name not in seen:
            seen.add(schema.name)
            store.register(typesys.get_types_from_msg(schema.data.decode("utf-8"), schema.name))
        yield channel.topic, schema.name, store.deserialize_cdr(message.data, schema.name), message.log_time


def _json(reader: Any) -> Iterator[Message]:
    for schema, channel, message in reader.iter_messages():
        if channel.message_encoding == "json":
            yield channel.topic, schema.name if schema else "", json.loads(message.data), message.log_time


def _tracks(messages: Any, understand: Any) -> tuple[dict[str, Track], dict[str, Track]]:
    """The positions and the forces of all messages, by their sources."""
    tracks: dict[str, Track] = {}
    forces: dict[str, Track] = {}
    for topic, kind, message, stamp in messages:
        felt: Felt
        for felt in understand(topic, kind, message, stamp):
            track = (forces if felt.force else tracks).setdefault(felt.source, Track())
            track.frames.add(felt.frame)
            track.times.append(felt.t)
            track.points.append(felt.points)
            track.sweeps, track.metres = felt.cloud, felt.metres
    return tracks, forces


def _log(path: Path, kind: str, tracks: dict[str, Track], forces: dict[str, Track], settings: Mapping[str, Any]) -> Log:
    """The log of the one source of positions, or of that which `part` names."""
    part = settings.get("part")
    direct = {source: track for source, track in tracks.items() if not source.startswith("/tf")}
    picked = {
        source: track for source, track in (tracks if part else direct or tracks).items() if part in (None, source)
    }
    if len(picked) != 1:
        raise UserError(
            f"{path}: field part: expected one source of positions in {kind}; found "
            f"{', '.join(tracks) or 'none'}; name one with --part /topic"
        )
    source, track = next(iter(picked.items()))
    if len(track.frames) != 1:
        raise UserError(f"{path}: the positions of {source} are in several frames: {', '.join(sorted(track.frames))}")
    counts = [len(each) for each in track.points]
    points, times = np.concatenate(track.points), np.repeat(track.times, counts)
    if not len(points):
        raise UserError(f"{path}: field samples: {source} holds none")
    frame = next(iter(track.frames))
    said = [f"positions of {source} in frame {frame!r}"]
    unit = " [m]" if track.metres else ""
    names, columns = [f"{axis}{unit}" for axis in "xyz"], [*points.T]
    order = np.argsort(track.times, kind="stable")
    force = _force(forces, frame, times, said)
    names += ["t [s]", *(("fx", "fy", "fz") if force is not None else ())]
    columns += [times - times.min(), *([] if force is None else force.T)]
    if track.sweeps and len(counts) > 1:
        names.append("sweep")
        columns.append(np.repeat(np.arange(len(counts)), counts).astype(np.float64))
    if not track.sweeps and not (np.diff(order) == 1).all():
        columns = [column[order] for column in columns]
        said.append("messages sorted by their stamps")
    return numbers_log(path, names, np.column_stack(columns), settings, kind, said)


def _force(forces: dict[str, Track], frame: str, times: np.ndarray, said: list[str]) -> np.ndarray | None:
    """(N, 3) forces at the times of the samples, N; None if there are none in the frame of the positions."""
    if len(forces) != 1:
        said += [f"forces of {', '.join(forces)} not used: which?"] if forces else []
        return None
    source, track = next(iter(forces.items()))
    if track.frames != {frame}:
        said.append(f"the force of {source} is in frame {', '.join(sorted(track.frames))!r} and not used")
        return None
    order = np.argsort(track.times, kind="stable")
    clock, values = np.array(track.times)[order], np.concatenate(track.points)[order]
    said.append(f"force of {source}, interpolated")
    return np.column_stack([np.interp(times, clock, values[:, axis]) for axis in range(3)])
