"""The registry: readers of ours and of other packages; the one that is surest of a file's first bytes reads it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from explore3d import UserError
from explore3d.log.own import LOG, Log, averaged_log, digest
from explore3d.log.readers.arrays import NpyArray, NpzArrays
from explore3d.log.readers.clouds import ObjPoints, PcdPoints, PlyPoints, StlPoints
from explore3d.log.readers.instruments import InstrumentFile, X3pFile
from explore3d.log.readers.lidar import LasPoints
from explore3d.log.readers.own import McapLog, StylusText, TextTable
from explore3d.log.readers.packed import Gzip, Zip
from explore3d.log.readers.probing import BcncProbe, GrblProbes, LinuxCncProbes, RepRapHeights
from explore3d.log.readers.reader import FIRST_BYTES, Reader
from explore3d.log.readers.ros import OtherMcap, RosBag
from explore3d.log.readers.tabular import ParquetTable, Workbook
from explore3d.log.readers.trajectories import PlotJugglerTable, TumTrajectory

GROUP = "explore3d.readers"
# A member's name, and what reads the archive that holds it as one file
ARCHIVES = {"[Content_Types].xml": Workbook().read, "main.xml": X3pFile().read}


@cache
def readers() -> tuple[Reader, ...]:
    """All readers, ours first; of equally sure ones the first wins.

    Raises:
        UserError: a reader of another package that cannot be loaded, named with its package.
    """
    ours: list[Reader] = [McapLog(), OtherMcap(), RosBag(), NpyArray(), NpzArrays(), ParquetTable(), PlyPoints()]
    ours += [PcdPoints(), LasPoints(), InstrumentFile(), Gzip(read_recording), Zip(read_recording, ARCHIVES)]
    ours += [ObjPoints(), StlPoints(), RepRapHeights(), GrblProbes(), BcncProbe(), LinuxCncProbes(), TumTrajectory()]
    ours += [PlotJugglerTable(), StylusText()]
    for entry in entry_points(group=GROUP):
        try:
            made = entry.load()
        except Exception as error:  # whatever another package stumbles over; it is named
            raise UserError(f"reader {entry.name!r} ({entry.value}) cannot be loaded: {error}") from error
        ours.append(made() if isinstance(made, type) else made)
    return (*ours, TextTable())


def reader_of(path: Path) -> Reader:
    """The reader of a file, by its first bytes.

    Raises:
        UserError: the file cannot be read.
    """
    if path.name == LOG and path.parent.is_dir() and not path.exists():
        raise UserError(f"{path.parent}: no session is in that folder: it holds no {LOG}")
    try:
        with path.open("rb") as file:
            first = file.read(FIRST_BYTES)
    except OSError as error:
        raise UserError(f"{path}: cannot read it: {error.strerror}") from error
    if not first and path.suffix != ".mcap":
        raise UserError(f"{path}: is empty")
    # a log of ours whose first bytes are destroyed is still one by its name
    text = first[:2] in (b"\xff\xfe", b"\xfe\xff") or not any(byte < 9 or 13 < byte < 32 for byte in first)
    if path.suffix == ".mcap" and not (first and text) and max(each.sniff(first) for each in readers()) <= 0.1:
        return readers()[0]
    return max(readers(), key=lambda each: each.sniff(first))


def _instead(folder: Path) -> str:
    """What to give instead of a folder without a log: of an analysis elsewhere, the recording that it read."""
    try:
        record = json.loads((folder / "session.json").read_text("utf-8"))
        job, command = str(record["job"]), str(record.get("command", ""))
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return "expected a log, a table, or the folder of a session with one"
    made = f"was made by: {command}" if command else f"is what explore3d {job} made of a file elsewhere"
    return f"what it holds {made}; give the recording that it was made from"


def read_recording(path: Path, settings: Mapping[str, Any]) -> Log:
    """What a file or a session's folder holds.

    Args:
        path: the file, or the folder, whose log is taken.
        settings: those of read_table; None means not said.

    Raises:
        UserError: one line naming the file and the field.
    """
    if path.is_dir():
        if not (path / LOG).is_file():
            raise UserError(f"{path}: is a folder without {LOG}; {_instead(path)}")
        path = path / LOG
    given = {key: value for key, value in settings.items() if value is not None}
    length = given.get("average")
    if length is not None and not (isinstance(length, int) and length >= 1):
        raise UserError(f"{path}: field average: expected a whole number of samples, 1 or more; found {length!r}")
    read = reader_of(path).read(path, given)
    if not isinstance(read, Log):
        about = {"read_as": [f"{reader_of(path).name}, {len(read)} rows"]}
        read = Log(trace=read, metadata=about, sha256=digest(path), sources=(str(path),), in_contact=False)
    return read if length is None or "average" in read.metadata else averaged_log(read, length)
