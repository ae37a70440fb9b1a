"""gz and zip: what is packed is unpacked beside, within bounds, and read by what it is."""

from __future__ import annotations

import gzip
import shutil
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, Any

from explore3d import UserError
from explore3d.log.own import Log

MOST_UNPACKED = 8 * 2**30  # bytes: 2e8 rows of text; more is no recording of a finger but a bomb
MOST_UNPACKING_RATIO = 250  # unpacked to packed: numbers in text stay below 100, zeros reach 1000
ALWAYS_UNPACKED = 64 * 2**20  # bytes that anything may unpack to
PIECE = 2**20  # bytes unpacked at a time

Read = Callable[[Path, Mapping[str, Any]], Log]


class Gzip:
    """One file in gzip."""

    name = "a gzip archive"
    unsaid: tuple[str, ...] = ()

    def __init__(self, read: Read) -> None:
        self._read = read

    def sniff(self, first: bytes) -> float:
        return 1.0 if first.startswith(b"\x1f\x8b") else 0.0

    def read(self, path: Path, settings: Mapping[str, Any]) -> Log:
        try:
            with gzip.open(path) as packed:
                return read_inside(path, path.name.removesuffix(".gz"), packed, self._read, settings)
        except (OSError, EOFError, zlib.error) as error:
            raise UserError(f"{path}: is a damaged gzip archive: {error}") from error


class Zip:
    """A ZIP archive with one recording; what else it holds must be a sidecar in TOML.

    Args:
        read: reads what is inside.
        others: by a member's name, what reads the archive as a whole: a workbook, an X3P file.
    """

    name = "a ZIP archive"
    unsaid: tuple[str, ...] = ()

    def __init__(self, read: Read, others: Mapping[str, Read]) -> None:
        self._read, self._others = read, others

    def sniff(self, first: bytes) -> float:
        return 0.9 if first.startswith(b"PK\x03\x04") else 0.0

    def read(self, path: Path, settings: Mapping[str, Any]) -> Log:
        try:
            with zipfile.ZipFile(path) as packed:
                inside = packed.infolist()
                check_sizes(path, inside)
                for member, reader in self._others.items():
                    if any(each.filename == member for each in inside):
                        return reader(path, settings)
                files = [each for each in inside if not each.is_dir() and not _beside(each.filename)]
                if len(files) != 1:
                    names = ", ".join(each.filename for each in files[:5]) or "nothing"
                    raise UserError(
                        f"{path}: expected one recording in the archive; found {names}; unpack it and name one"
                    )
                with packed.open(files[0]) as content:
                    return read_inside(path, Path(files[0].filename).name, content, self._read, settings)
        except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, OSError) as error:
            raise UserError(f"{path}: is a ZIP archive that cannot be read: {error}") from error


def check_sizes(path: Path, inside: Sequence[zipfile.ZipInfo]) -> None:
    """Refuse an archive that claims to hold more than a recording can be.

    Raises:
        UserError: naming the sizes.
    """
    packed, unpacked = sum(each.compress_size for each in inside), sum(each.file_size for each in inside)
    _bounded(path, packed, unpacked)


def _bounded(path: Path, packed: int, unpacked: int) -> None:
    if unpacked > MOST_UNPACKED or unpacked > max(ALWAYS_UNPACKED, MOST_UNPACKING_RATIO * packed):
        raise UserError(
            f"{path}: holds {unpacked:,} bytes or more in {packed:,}; a recording is at most "
            f"{MOST_UNPACKING_RATIO} times its packed size and {MOST_UNPACKED:,} bytes; "
            "unpack it yourself if you trust it"
        )


def _beside(name: str) -> bool:
    return name.startswith(("__MACOSX/", ".")) or name.endswith((".toml", ".DS_Store"))


def read_inside(
    path: Path, name: str, packed: IO[bytes] | gzip.GzipFile, read: Read, settings: Mapping[str, Any]
) -> Log:
    """Unpack piece by piece into a folder of its own, that is gone afterwards, and read.

    Args:
        path: the archive.
        name: of what is in it.
        packed: gives its bytes.
        read: the reader.

    Raises:
        UserError: more than a recording can be, or what the reader raises, naming the archive.
    """
    with TemporaryDirectory(prefix="explore3d-") as folder:
        inner = Path(folder) / (name or "recording")
        size, outer = 0, path.stat().st_size
        with inner.open("wb") as file:
            while piece := packed.read(PIECE):
                size += len(piece)
                _bounded(path, outer, size)
                file.write(piece)
        for sidecar, other in ((Path(f"{path}.toml"), f"{inner}.toml"), (path.with_suffix(".toml"), f"{inner}.toml")):
            if sidecar.is_file() and not Path(other).exists():
                shutil.copy(sidecar, other)
        with _named(str(inner), str(path)):
            log = read(inner, settings)
    return replace(log, sources=(str(path),))


@contextmanager
def _named(inner: str, outer: str) -> Iterator[None]:
    """Errors name the archive, not the place where it was unpacked."""
    try:
        yield
    except UserError as error:
        raise UserError(str(error).replace(inner, outer)) from error
