"""Readers of our own logs and of tables of numbers in text."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from explore3d import UserError, parse_length
from explore3d.log.own import MAGIC, Log, averaged_file, read_log
from explore3d.log.table import load_settings, read_table
from explore3d.log.text import length_factor
from mapping import length_text

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
        log = read_table(path, **_of_a_table(settings))
        lines = [line for line, _ in _radii(_beginning(path))]
        return _said(log, f"no radius was taken from {', '.join(map(repr, lines))}") if lines else log


# Lines of words that state a tip: "Stylus Type,Radius: 2.5 um", "Stylus radius (µm): 2", "# tip radius = 5 um",
# "Ball diameter: 6 mm", and the same in cells of a sheet; a stylus' own diameter may be its shaft's
_GAP = r"[^\S\n]*"
_TIP_LINE = re.compile(
    r"(?im)^(?P<line>[^\n]*(?:(?:stylus|tip|probe|ball)[^\n]*?radius|(?:tip|ball)[ _]*(?P<twice>diameter))"
    rf"{_GAP}(?:[\[(](?P<before>[^\])\n]+)[\])])?{_GAP}[ :=,;\t]{_GAP}\"?(?P<number>\d+(?:[.,]\d+)?)"
    rf"(?:{_GAP}[;,\t]?{_GAP}(?P<unit>[a-zA-Zµμ]+))?)"
)


class StylusText:
    """A table under words that state the radius of the tip, as stylus profilers (Dektak and others) write."""

    name = "a stylus instrument's text"
    unsaid: tuple[str, ...] = ()

    def sniff(self, first: bytes) -> float:
        return 0.8 if stated_radius(first) is not None else 0.0

    def read(self, path: Path, settings: Mapping[str, Any]) -> Log:
        stated = stated_radius(_beginning(path))
        given, _ = load_settings(path, **_of_a_table(settings))
        agreed = one_radius(path, given.tip_radius, stated)
        log = read_table(path, **_of_a_table(settings) | {"tip_radius": agreed})
        return log if stated is None else _said(log, f"the tip's radius, {length_text(stated)}, is stated in it")


LONGEST_PREAMBLE = 65536  # bytes before an instrument's numbers: they write a few kilobytes


def _beginning(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(LONGEST_PREAMBLE)


def _of_a_table(settings: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in settings.items() if key != "part"}


def _said(log: Log, words: str) -> Log:
    """The log, with these words at the end of how it was read."""
    *others, last = log.metadata["read_as"]
    return replace(log, metadata=log.metadata | {"read_as": [*others, f"{last}, {words}"]})


def stated_radius(first: bytes) -> float | None:
    """The radius of the tip that the words before the numbers state, m; None if they state none, or more than one."""
    radii = {radius for _, radius in _radii(first)}
    return radii.pop() if len(radii) == 1 else None


def _radii(first: bytes) -> list[tuple[str, float | None]]:
    """Lines that speak of a tip's radius, and the radius of each, m; None where that is no length above 0."""
    found = []
    for hit in _TIP_LINE.finditer("" if b"\0" in first else _words(first)):
        factor = length_factor(hit["unit"] or hit["before"] or "") or length_factor(hit["before"] or "")
        radius = float(hit["number"].replace(",", ".")) * (factor or 0.0) / (2.0 if hit["twice"] else 1.0)
        found.append((hit["line"].strip(), radius or None))
    return found


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
