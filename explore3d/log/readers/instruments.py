"""Readers of maps and profiles of surface instruments: X3P, and what the package SurfaceTopography knows."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from explore3d import UserError, unit_factor
from explore3d.log.own import Log
from explore3d.log.readers.arrays import numbers_log
from explore3d.log.readers.optional import claimed, decoding, library
from explore3d.log.readers.own import POINT, TIP
from explore3d.log.table import heights_log, load_settings
from explore3d.log.text import length_factor

# The first bytes of a format, its name in the package, and what people call it
_FORMATS = (
    (b"DIGITAL SURF", "sur", "a Digital Surf file (SUR)"),
    (b"DSCOMPRESSED", "sur", "a Digital Surf file (SUR)"),
    (b"aISO-1.0", "sdf", "a surface data file (SDF)"),
    (b"bISO-1.0", "sdf", "a surface data file (SDF)"),
    (b"VCA DATA\x01\x00\x00\x55", "opdx", "a Dektak file (OPDX)"),
    (b"\\*File list", "di", "a Digital Instruments file (DI)"),
    (b"\\*Force file list", "di", "a Digital Instruments file (DI)"),
    (b"GWYP", "gwy", "a Gwyddion file (GWY)"),
    (b"VK3_", "vk", "a Keyence file (VK)"),
    (b"VK4_", "vk", "a Keyence file (VK)"),
    (b"VK6", "vk", "a Keyence file (VK)"),
    (b"VK7", "vk", "a Keyence file (VK)"),
)
_OPD = b"Directory"  # of a Wyko file, from its third byte on
MITUTOYO = ("mitutoyo", "a Mitutoyo SurfTest workbook")


class InstrumentFile:
    """A map or profile by its instrument's own format; `part` names the channel, if several hold heights."""

    name = "a surface instrument's file"
    unsaid: tuple[str, ...] = (TIP, POINT)

    def sniff(self, first: bytes) -> float:
        return 0.95 if _format(first) else 0.0

    def read(self, path: Path, settings: Mapping[str, Any]) -> Log:
        with path.open("rb") as file:
            known = _format(file.read(64))
        if known is None:
            raise UserError(f"{path}: is no file of an instrument that is known")
        return instrument_log(path, settings, known)


def _format(first: bytes) -> tuple[str, str] | None:
    if first[2 : 2 + len(_OPD)] == _OPD:
        return "opd", "a Wyko file (OPD)"
    return next(((name, words) for magic, name, words in _FORMATS if first.startswith(magic)), None)


def instrument_log(path: Path, settings: Mapping[str, Any], known: tuple[str, str]) -> Log:
    """What an instrument's file holds.

    Args:
        known: the format's name in SurfaceTopography, and what people call it.

    Raises:
        UserError: the package is missing, the file is damaged, or it leaves open what is meant.
    """
    name, kind = known
    package = library(path, "SurfaceTopography.IO", "instruments", kind)
    given, sidecar = load_settings(path, **settings)
    with decoding(path, kind):
        reader = next(each for each in package.readers if each.format() == name)
        with reader(str(path)) as file:
            channel = _channel(path, kind, list(file.channels), given.part)
            points = channel.nb_grid_pts or ()
            claimed(path, kind, int(np.prod([float(each) for each in points])) if points else 0)
            size = None if channel.physical_sizes or given.pixel is None else _sizes(points, given.pixel)
            surface = channel.topography() if size is None else channel.topography(physical_sizes=size)
            heights = np.ma.filled(np.ma.masked_invalid(surface.heights()), np.nan)
            unit = _of_heights(path, surface.unit)
            along = surface.positions() if surface.dim == 1 else None
            pixels = None if surface.dim == 1 or surface.physical_sizes is None else surface.pixel_size
    said = [f"channel {channel.name!r}"]
    if along is not None:
        bracket = f" [{unit}]" if unit else ""
        return numbers_log(
            path, (f"x{bracket}", f"z{bracket}"), np.column_stack([along, heights]), settings, kind, said
        )
    if pixels is None:
        raise UserError(f'{path}: field pixel: {kind} does not state how far its pixels are apart: --pixel "1 um"')
    return map_log(path, heights.T, (float(pixels[0]), float(pixels[1])), unit, given, sidecar, said, kind)


def map_log(
    path: Path,
    heights: np.ndarray,
    pixel: tuple[float, float],
    unit: str,
    given: Any,
    sidecar: Path | None,
    said: list[str],
    kind: str,
) -> Log:
    """The log of a map (rows, columns) whose pixels and heights are in one unit.

    Raises:
        UserError: a unit that is none, or that nobody states.
    """
    asked = given.units if isinstance(given.units, str) else (given.units or {}).get("z")
    factor = length_factor(unit) if unit else unit_factor(asked) if asked else None
    if factor is None:
        raise UserError(f"{path}: field units: {kind} states {unit or 'none'!r}; give them with --units um")
    metres = (pixel[0] * factor, pixel[1] * factor)
    return heights_log(path, heights, metres, unit, given, sidecar, said, kind)


def _sizes(points: tuple[int, ...], pixel: tuple[float, float]) -> tuple[float, ...]:
    return tuple(count * step for count, step in zip(points, pixel, strict=False))


def _of_heights(path: Path, unit: Any) -> str:
    """The unit of a channel; a pair of the lateral one and another is no map of heights: volts, degrees.

    Raises:
        UserError: naming both.
    """
    if isinstance(unit, tuple):
        raise UserError(
            f"{path}: field part: expected a channel of heights; found one in {' and '.join(map(str, unit))}"
        )
    return str(unit or "")


def _channel(path: Path, kind: str, channels: list[Any], part: str | None) -> Any:
    """The channel of heights that is asked for, or the only one."""
    heights = [each for each in channels if each.data_kind.value == "height"]
    named = [each for each in heights if part is None or each.name == part]
    if part is not None and part.isdecimal() and 1 <= int(part) <= len(heights):  # names may repeat: trace and retrace
        named = [heights[int(part) - 1]]
    if len(named) == 1:
        return named[0]
    names = ", ".join(repr(each.name) for each in heights[:8]) or "none"
    raise UserError(
        f"{path}: field part: expected one channel of heights in {kind}; found {names}; name one with --part, "
        "or by its number from 1"
    )


class X3pFile:
    """A profile, a map or points in X3P (ISO 25178-72), in metres; `part` is the number of the layer, from 1."""

    name = "an X3P file"
    unsaid: tuple[str, ...] = (TIP, POINT)

    def read(self, path: Path, settings: Mapping[str, Any]) -> Log:
        """What its layer holds.

        Raises:
            UserError: one line naming the file and what it lacks.
        """
        x3pio = library(path, "x3pio", "formats", self.name)
        part = settings.get("part")
        with decoding(path, self.name):
            layers = x3pio.read(str(path)).layers
            if len(layers) != 1 and not (part and part.isdecimal() and 1 <= int(part) <= len(layers)):
                raise UserError(f"{path}: field part: expected one layer; found {len(layers)}: name one with --part 1")
            points = np.asarray(layers[int(part) - 1 if part else 0].points(), dtype=np.float64)
            if points.ndim == 3 and points.shape[0] > 1:
                sweep = np.repeat(np.arange(points.shape[0]), points.shape[1])
                rows = np.column_stack([points.reshape(-1, points.shape[2]), sweep])
                names = ["x [m]", "y [m]", "z [m]", "sweep"]
            else:
                rows = points.reshape(-1, points.shape[-1])
                names = ["x [m]", "y [m]", "z [m]"] if rows.shape[1] == 3 else ["x [m]", "z [m]"]
        return numbers_log(path, names, rows, settings, self.name)
