"""Readers of what machine tools and 3D printers write when they probe: Grbl, bCNC, LinuxCNC, RepRap."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from explore3d import UserError
from explore3d.log.own import Log
from explore3d.log.readers.arrays import numbers_log
from explore3d.log.readers.own import TIP
from explore3d.log.table import heights_log, load_settings

TOUCH = "whether heights are the ball's centre or its lowest point (reference)"
_NUMBER = rb"[-+]?\d*\.?\d+(?:[eE][-+]?\d+)?"
_PRB = re.compile(rb"\[PRB:(" + _NUMBER + rb"),(" + _NUMBER + rb"),(" + _NUMBER + rb")(?:,[-+.\d]+)*:([01])\]")
_INCHES = re.compile(rb"(?m)^\$13=([01])")
_ROW = rb"[ \t]*" + rb"[ \t]+".join([_NUMBER] * 3) + rb"[ \t]*\r?\n"
_BCNC = re.compile(rb"\s*" + (rb"(" + _ROW + rb")") * 3 + rb"\s*(" + _ROW + rb")")
_NINE = re.compile(rb"[ \t]*" + rb"[ \t]+".join([rb"(-?\d+\.\d{3,})"] * 9) + rb"[ \t]*\r?$")


class GrblProbes:
    """Probe results `[PRB:x,y,z:1]` in the log of a sender for Grbl; pecks that touched nothing are left out."""

    name = "a Grbl log of probes"
    unsaid: tuple[str, ...] = ("the units, unless it holds $13", TIP, TOUCH)

    def sniff(self, first: bytes) -> float:
        return 0.9 if _PRB.search(first) else 0.0

    def read(self, path: Path, settings: Mapping[str, Any]) -> Log:
        data = path.read_bytes()
        broken = data.count(b"[PRB:") - len(_PRB.findall(data))
        rows = np.array([[float(cell) for cell in hit] for hit in _PRB.findall(data)])
        said = [f"{broken} results that are cut or damaged left out"] if broken else []
        report = set(_INCHES.findall(data))
        unit = "" if len(report) != 1 else " [inch]" if b"1" in report else " [mm]"
        names = [f"{axis}{unit}" for axis in "xyz"]
        return numbers_log(path, (*names, "valid"), rows, settings, "a Grbl log of probes", said)


class BcncProbe:
    """The map of heights that bCNC keeps for levelling: limits and counts in three lines, then the points."""

    name = "a bCNC probe file"
    unsaid: tuple[str, ...] = ("the units", TIP, TOUCH)

    def sniff(self, first: bytes) -> float:
        return 0.8 if _bcnc_counts(first) is not None else 0.0

    def read(self, path: Path, settings: Mapping[str, Any]) -> Log:
        data = path.read_bytes()
        counts = _bcnc_counts(data)
        if counts is None:
            raise UserError(f"{path}: is a damaged bCNC probe file: its limits and counts do not fit its points")
        lines = [line.split() for line in data.splitlines() if line.strip()][3:]
        along, across = counts
        if len(lines) != along * across or any(len(line) != 3 for line in lines):
            raise UserError(f"{path}: expected {along} x {across} points of three numbers; found {len(lines)} lines")
        try:
            rows = np.array(lines, dtype=np.float64)
        except ValueError as error:
            raise UserError(f"{path}: is a damaged bCNC probe file: {error}") from error
        rows = np.column_stack([rows, np.repeat(np.arange(across), along)])
        return numbers_log(path, ("x", "y", "z", "sweep"), rows, settings, "a bCNC probe file")


def _bcnc_counts(first: bytes) -> tuple[int, int] | None:
    hit = _BCNC.match(first)
    if hit is None:
        return None
    (x0, x1, xn), (y0, y1, yn), _, (x, y, _) = ([float(cell) for cell in line.split()] for line in hit.groups())
    whole = xn.is_integer() and yn.is_integer() and 2 <= xn < 1e6 and 2 <= yn < 1e6
    begins = np.isclose([x, y], [x0, y0], rtol=1e-4, atol=1e-4 * max(abs(x1 - x0), abs(y1 - y0))).all()
    return (int(xn), int(yn)) if whole and x1 > x0 and y1 > y0 and begins else None


class LinuxCncProbes:
    """What LinuxCNC writes between PROBEOPEN and PROBECLOSE: the nine axes of the machine at each touch."""

    name = "a LinuxCNC probe log"
    unsaid: tuple[str, ...] = ("the units", TIP, TOUCH)

    def sniff(self, first: bytes) -> float:
        lines = [line for line in first.split(b"\n") if line.strip()]
        lines = lines[:-1] if len(first) >= 4000 else lines
        rows = [_NINE.match(line) for line in lines]
        if len(rows) < 2 or not all(rows):
            return 0.0
        return 0.6 if len({hit.groups()[3:] for hit in rows if hit}) == 1 else 0.0

    def read(self, path: Path, settings: Mapping[str, Any]) -> Log:
        lines = [line for line in path.read_bytes().split(b"\n") if line.strip()]
        hits = [_NINE.match(line) for line in lines]
        rows = np.array([[float(cell) for cell in hit.groups()] for hit in hits if hit])
        odd = [number for number, hit in enumerate(hits, 1) if hit is None]
        if odd and odd != [len(lines)]:
            raise UserError(f"{path}: line {odd[0]}: expected nine numbers; found {lines[odd[0] - 1][:40]!r}")
        turned = rows[:, 3:6]
        if len(turned) and np.ptp(turned, axis=0).any():
            raise UserError(f"{path}: the axes a, b, c turned between the touches: x, y, z are not of one frame")
        said = ["the last line was incomplete and is left out"] if odd else []
        return numbers_log(path, ("x", "y", "z"), rows[:, :3], settings, "a LinuxCNC probe log", said)


class RepRapHeights:
    """The height map of a 3D printer's bed (heightmap.csv of RepRapFirmware), in mm."""

    name = "a RepRap height map"
    unsaid: tuple[str, ...] = (TIP, TOUCH)

    def sniff(self, first: bytes) -> float:
        return 1.0 if first.lstrip(b"\xef\xbb\xbf").startswith(b"RepRapFirmware height map file") else 0.0

    def read(self, path: Path, settings: Mapping[str, Any]) -> Log:
        lines = path.read_text("latin-1").splitlines()
        if len(lines) < 4:
            raise UserError(f"{path}: is a RepRap height map that is cut")
        said = dict(zip((each.strip() for each in lines[1].split(",")), lines[2].split(","), strict=False))
        keys = [("xmin", "min0"), ("ymin", "min1"), ("xspacing", "spacing0"), ("yspacing", "spacing1")]
        keys += [("xnum", "num0"), ("ynum", "num1")]
        try:
            least_x, least_y, along, across, columns, rows = (float(said.get(a) or said[b]) for a, b in keys)
            # a point that was not probed is written as 0 without a decimal point
            cells = [
                [np.nan if cell.strip() == "0" else float(cell) for cell in line.split(",")]
                for line in lines[3:]
                if line.strip()
            ]
        except (KeyError, ValueError) as error:
            raise UserError(f"{path}: is a damaged RepRap height map: {error}") from error
        if len(cells) != rows or any(len(line) != columns for line in cells) or not (along > 0 and across > 0):
            raise UserError(f"{path}: expected {columns:g} x {rows:g} heights; found {len(cells)} rows")
        given, sidecar = load_settings(path, **settings)
        moved = given.frame.model_copy(update={"origin": _moved(given.frame, 1e-3 * least_x, 1e-3 * least_y)})
        given = given.model_copy(update={"frame": moved})
        pixel = (1e-3 * along, 1e-3 * across)
        return heights_log(path, np.array(cells), pixel, "mm", given, sidecar, kind="a RepRap height map")


def _moved(frame: Any, x: float, y: float) -> tuple[float, float, float]:
    origin = np.array(frame.origin) + np.array(frame.rotation, dtype=np.float64) @ np.array([x, y, 0.0])
    return (float(origin[0]), float(origin[1]), float(origin[2]))
