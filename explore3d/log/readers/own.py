"""Readers of our own logs and of tables of numbers in text."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from explore3d import parse_length
from explore3d.log import MAGIC, Log, read_log

TIP = "the radius of the fingertip"
POINT = "whether heights are the tip's or the surface's (taken as the tip's)"


class McapLog:
    """Our own logs; of other programs' MCAP files the reader says what is missing."""

    name = "an MCAP log"
    unsaid: tuple[str, ...] = ()

    def sniff(self, first: bytes) -> float:
        return 1.0 if first.startswith(MAGIC) else 0.0

    def read(self, path: Path, settings: Mapping[str, Any]) -> Log:
        radius = settings.get("tip_radius")
        return read_log(path, None if radius is None else parse_length(radius))


class TextTable:
    """CSV and TXT; the last that is asked, since any text may be a table."""

    name = "a table of numbers"
    unsaid: tuple[str, ...] = (TIP, POINT)

    def sniff(self, first: bytes) -> float:
        return 0.1

    def read(self, path: Path, settings: Mapping[str, Any]) -> Log:
        from explore3d.log import read_table

        return read_table(path, **settings)
