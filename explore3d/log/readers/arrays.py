"""Readers of NumPy's files: numbers alone, nothing that could run (`allow_pickle=False`)."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from explore3d import UserError
from explore3d.log.own import Log
from explore3d.log.readers.own import POINT, TIP
from explore3d.log.readers.packed import check_sizes
from explore3d.log.table import heights_log, load_settings, table_log
from explore3d.log.text import TableText, name_and_unit


class NpyArray:
    """One array: (N, C) numbers, or (N,) with named fields."""

    name = "a NumPy array (.npy)"
    unsaid: tuple[str, ...] = ("the units", "the names of the columns, unless the array has fields", TIP, POINT)

    def sniff(self, first: bytes) -> float:
        return 1.0 if first.startswith(b"\x93NUMPY") else 0.0

    def read(self, path: Path, settings: Mapping[str, Any]) -> Log:
        try:
            # mapped, so that a size that the header claims and the file has not takes no memory
            array = np.load(path, mmap_mode="r", allow_pickle=False)
        except Exception as error:  # the parser of headers raises whatever it stumbles over
            raise UserError(f"{path}: is not a NumPy array of numbers that can be read: {first_line(error)}") from error
        return map_or_numbers(path, array, settings, "a NumPy array")


class NpzArrays:
    """Several arrays: one (N, C), or one (N,) for each column; kinds of columns are known by their names."""

    name = "NumPy arrays (.npz)"
    unsaid: tuple[str, ...] = ("the units", TIP, POINT)

    def sniff(self, first: bytes) -> float:
        # a local file header's name stands at byte 30; the zip reader is less sure
        length = int.from_bytes(first[26:28], "little")
        return 1.0 if first.startswith(b"PK\x03\x04") and first[30 : 30 + length].endswith(b".npy") else 0.0

    def read(self, path: Path, settings: Mapping[str, Any]) -> Log:
        try:
            with zipfile.ZipFile(path) as packed:
                check_sizes(path, packed.infolist())
            with np.load(path, allow_pickle=False) as arrays:
                found = {name: arrays[name] for name in arrays.files}
        except UserError:
            raise
        except Exception as error:  # unpacking and the parser of headers raise whatever they stumble over
            raise UserError(f"{path}: is not an archive of NumPy arrays of numbers: {first_line(error)}") from error
        tables = {name: array for name, array in found.items() if array.ndim == 2 or array.dtype.names}
        if len(tables) == 1:
            return map_or_numbers(path, next(iter(tables.values())), settings, "NumPy arrays")
        columns = {name: array for name, array in found.items() if array.ndim == 1 and array.dtype.kind in "fiub"}
        lengths = {len(array) for array in columns.values()}
        if len(columns) < 2 or len(lengths) != 1:
            shapes = ", ".join(f"{name} {array.shape}" for name, array in list(found.items())[:8])
            raise UserError(
                f"{path}: field columns: expected one (N, C) array or columns of one length; found {shapes}"
            )
        rows = np.column_stack([array.astype(np.float64) for array in columns.values()])
        return numbers_log(path, tuple(columns), rows, settings, "NumPy arrays")


def columns_of(path: Path, array: np.ndarray) -> tuple[tuple[str, ...], np.ndarray]:
    """Names and (N, C) float64 of an array.

    Raises:
        UserError: it is no table of numbers.
    """
    if array.dtype.names and array.ndim == 1:
        names = tuple(
            name for name in array.dtype.names if array.dtype[name].kind in "fiub" and not array.dtype[name].shape
        )
        return names, np.column_stack([array[name].astype(np.float64) for name in names]) if names else np.zeros((0, 0))
    if array.dtype.kind not in "fiub" or array.ndim != 2:
        raise UserError(
            f"{path}: field columns: expected (N, C) numbers, a column each for x, y, z or x, z; found {array.dtype} "
            f"of shape {array.shape}"
        )
    if array.shape[0] < array.shape[1] <= 64 or array.shape[1] > 64:
        raise UserError(
            f"{path}: field columns: expected (N, C), a row for each sample; found shape {array.shape}: transpose it, "
            'or if it is a map of heights, say how far its pixels are apart: --pixel "1 um"'
        )
    return ("",) * array.shape[1], np.array(array, dtype=np.float64)


def numbers_log(
    path: Path,
    names: Sequence[str],
    rows: np.ndarray,
    settings: Mapping[str, Any],
    kind: str,
    said: Sequence[str] = (),
    resolution: float = 0.0,
) -> Log:
    """The log of named columns of numbers; units come from the names ("x_mm") or from the settings.

    Args:
        names: of the columns, "" where the file has none.
        rows: (N, C).
        kind: what the file is.
        said: what was recognised.
        resolution: step of the positions, in the file's own unit of x; 0: none.

    Raises:
        UserError: no rows, or what the columns do not say.
    """
    if not len(rows):
        raise UserError(f"{path}: field samples: it holds none")
    parts = [name_and_unit(name) for name in names]
    text = TableText(
        path, tuple(n for n, _ in parts), tuple(unit for _, unit in parts), np.array(rows), said=tuple(said), kind=kind
    )
    log = table_log(text, *load_settings(path, **settings))
    if not resolution:
        return log
    return replace(log, trace=replace(log.trace, resolution=resolution * log.metadata["metres_per_unit"]["x"]))


def few_digits(kinds: Sequence[Any]) -> list[str]:
    """A word on columns that keep seven digits at most."""
    short = any(np.dtype(kind).kind == "f" and np.dtype(kind).itemsize < 8 for kind in kinds)
    return ["on the grid of 32-bit numbers, seven digits"] if short else []


def map_or_numbers(path: Path, array: np.ndarray, settings: Mapping[str, Any], kind: str) -> Log:
    """The log of one array: of a map of heights if the settings say how far its pixels are apart, else of columns."""
    given, sidecar = load_settings(path, **settings)
    if given.pixel is None:
        return numbers_log(path, *columns_of(path, array), settings, kind, few_digits([array.dtype]))
    if array.dtype.kind not in "fiub" or array.ndim != 2:
        raise UserError(f"{path}: field heights: expected rows of heights; found {array.dtype} of shape {array.shape}")
    return heights_log(path, np.asarray(array, dtype=np.float64), given.pixel, "", given, sidecar, kind=kind)


def first_line(error: Exception) -> str:
    """What an error of a library says, in one line."""
    return (str(error).splitlines() or [type(error).__name__])[0]
