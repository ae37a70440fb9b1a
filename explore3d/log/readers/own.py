"""Readers of our own logs and of tables of numbers in text."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from explore3d import UserError, parse_length
from explore3d.log.own import MAGIC, Log, averaged_file, read_log
from explore3d.log.table import load_settings, read_table, table_log
from explore3d.log.text import length_factor, read_text

TIP = "the radius of the fingertip"
POINT = "whether heights are the tip's or the surface's (taken as the tip's)"
# Of MCAP files of other programs: what stands behind the length of the header's first record, the profile
_OTHER_PROFILES = ("", "ros1", "ros2")


def of_others(first: bytes) -> bool:
    """True if a file begins as the MCAP file of another program: its profile is not ours."""
    if not first.startswith(MAGIC) or first[8:9] != b"\x01":
        return False
    size = int.from_bytes(first[17:21], "little")
    return size <= 4 and first[21 : 21 + size].decode("latin-1") in _OTHER_PROFILES


class McapLog:
    """Our own logs."""

    name = "an MCAP log"
    unsaid: tuple[str, ...] = ()

    def sniff(self, first: bytes) -> float:
        return 1.0 if first.startswith(MAGIC) and not of_others(first) else 0.0

    def read(self, path: Path, settings: Mapping[str, Any]) -> Log:
        given, length = settings.get("tip_radius"), settings.get("average")
        radius = None if given is None else parse_length(given)
        return read_log(path, radius) if length is None else averaged_file(path, radius, length)


class TextTable:
    """CSV and TXT; the last that is asked, since any text may be a table."""

    name = "a table of numbers"
    unsaid: tuple[str, ...] = (TIP, POINT)

    def sniff(self, first: bytes) -> float:
        return 0.1

    def read(self, path: Path, settings: Mapping[str, Any]) -> Log:
        return read_table(path, **{key: value for key, value in settings.items() if key != "part"})


# Of a stylus instrument's own export: "Stylus Type,Radius: 2.5 um", "Stylus radius (µm): 2"
_STYLUS = re.compile(
    r"(?im)^[^\n]*stylus[^\n]*radius\s*(?:[\[(](?P<before>[^\])\n]+)[\])])?\s*[:=,;\t]\s*\"?(?P<number>\d+(?:[.,]\d+)?)"
    r"\s*(?P<unit>[a-zA-Zµμ]*)"
)


class StylusText:
    """The text of a stylus profiler (Dektak and others) that states the radius of its stylus."""

    name = "a stylus instrument's text"
    unsaid: tuple[str, ...] = ()

    def sniff(self, first: bytes) -> float:
        return 0.8 if stated_radius(first) is not None else 0.0

    def read(self, path: Path, settings: Mapping[str, Any]) -> Log:
        with path.open("rb") as file:
            stated = stated_radius(file.read(LONGEST_PREAMBLE))
        given, sidecar = load_settings(path, **{key: value for key, value in settings.items() if key != "part"})
        agreed = one_radius(path, given.tip_radius, stated)
        return table_log(read_text(path, given.decimal), given.model_copy(update={"tip_radius": agreed}), sidecar)


LONGEST_PREAMBLE = 65536  # bytes before an instrument's numbers: they write a few kilobytes


def stated_radius(first: bytes) -> float | None:
    """The radius of the stylus that the words before the numbers state, m; None if they do not."""
    if b"\0" in first:
        return None
    hit = _STYLUS.search(_words(first))
    if hit is None:
        return None
    factor = length_factor(hit["unit"] or hit["before"] or "")
    return None if factor is None else float(hit["number"].replace(",", ".")) * factor


def _words(first: bytes) -> str:
    try:
        return first.decode("utf-8")
    except UnicodeDecodeError:
        return first.decode("latin-1")


SAME_RADIUS = 0.01  # share by which a radius that is given may differ from that of the file: rounded numbers do


def one_radius(path: Path, asked: float | None, stated: float | None) -> float | None:
    """The radius of the tip that the file states or the user gives.

    Raises:
        UserError: both, and they differ.
    """
    if asked is None or stated is None:
        return stated if asked is None else asked
    if abs(asked - stated) > SAME_RADIUS * stated:
        raise UserError(
            f"{path}: field tip_radius: {asked:g} m is asked for, but the file states a stylus of {stated:g} m"
        )
    return asked
