"""Readers of trajectories in text: TUM, and the tables that PlotJuggler writes of recorded topics."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from explore3d import UserError
from explore3d.log.own import Log
from explore3d.log.readers.own import POINT, TIP
from explore3d.log.table import load_settings, table_log
from explore3d.log.text import read_text

UNIT_QUATERNION = 5e-3  # by which a length of 1 is missed where orientations have four digits
_SERIES = re.compile(r"^(?P<group>.*?(?:position|point|translation))[/.](?P<axis>[xyz])$", re.I)
_TIMES = ("__time", "time", "timestamp", "t")


class TumTrajectory:
    """`timestamp tx ty tz qx qy qz qw` in metres and seconds, a line for each pose."""

    name = "a TUM trajectory"
    unsaid: tuple[str, ...] = (TIP, POINT, "which point of the tool the poses are of (taken as the ball's centre)")

    def sniff(self, first: bytes) -> float:
        lines = first.split(b"\n")
        lines = [line for line in (lines[:-1] if len(first) >= 4000 else lines) if line.strip()]
        poses = [line.split() for line in lines if not line.lstrip().startswith(b"#")]
        if not poses or any(len(pose) != 8 for pose in poses):
            return 0.0
        try:
            turns = np.array([[float(cell) for cell in pose] for pose in poses])[:, 4:]
        except ValueError:
            return 0.0
        return 0.7 if np.abs(np.sum(turns**2, axis=1) - 1.0).max() < 2 * UNIT_QUATERNION else 0.0

    def read(self, path: Path, settings: Mapping[str, Any]) -> Log:
        given, sidecar = load_settings(path, **settings)
        text = read_text(path, given.decimal)
        if len(text.names) != 8:
            raise UserError(f"{path}: expected 8 numbers a line (timestamp, tx ty tz, qx qy qz qw)")
        names = ("t", "x", "y", "z", *[""] * 4)
        units = ("s", "m", "m", "m", *[""] * 4)
        return table_log(replace(text, names=names, units=units, kind=self.name), given, sidecar)


class PlotJugglerTable:
    """Series of topics as columns, `/tip/pose/position/x`; the position whose name `part` begins, if several."""

    name = "a table of topics"
    unsaid: tuple[str, ...] = ("the units", TIP, POINT)

    def sniff(self, first: bytes) -> float:
        header = first.split(b"\n", 1)[0].decode("utf-8", "replace").strip()
        return 0.6 if _groups(tuple(re.split(r"[,;\t]", header.replace('"', "")))) else 0.0

    def read(self, path: Path, settings: Mapping[str, Any]) -> Log:
        given, sidecar = load_settings(path, **settings)
        text = read_text(path, given.decimal)
        if given.columns:
            return table_log(text, given, sidecar)
        # the last part of a topic's name reads like a unit behind a slash
        full = [
            f"{name}/{unit}" if unit in set("xyz") else name for name, unit in zip(text.names, text.units, strict=True)
        ]
        groups = _groups(tuple(full))
        picked = {name: axes for name, axes in groups.items() if given.part is None or name.startswith(given.part)}
        if len(picked) != 1:
            raise UserError(
                f"{path}: field part: expected one position; found {', '.join(picked or groups) or 'none'}; name one "
                'with --part "/tip"'
            )
        names, units = [""] * len(full), ["" if unit in set("xyz") else unit for unit in text.units]
        for axis, index in next(iter(picked.values())).items():
            names[index] = axis
        clock = next((index for index, name in enumerate(text.names) if name.lower() in _TIMES), None)
        if clock is not None:
            names[clock], units[clock] = "t", "s"
        said = (*text.said, f"the position is {next(iter(picked))}")
        text = replace(text, names=tuple(names), units=tuple(units), said=said, kind=self.name)
        return table_log(text, given, sidecar)


def _groups(names: tuple[str, ...]) -> dict[str, dict[str, int]]:
    """Positions with all three axes: the name of each without its axis, and the columns of x, y, z."""
    found: dict[str, dict[str, int]] = {}
    for index, name in enumerate(names):
        if hit := _SERIES.match(name.strip()):
            found.setdefault(hit["group"], {})[hit["axis"].lower()] = index
    return {group: axes for group, axes in found.items() if len(axes) == 3}
