"""Places: folders of this machine and of object stores behind one small interface (fsspec, extra `cluster`)."""

from __future__ import annotations

import contextlib
import hashlib
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Protocol

from explore3d import UserError
from mapping.geometry.mesh import write_whole

# Bytes that are fetched at a time
BLOCK_BYTES = 8 << 20


def is_remote(place: str) -> bool:
    """True for an address, "s3://bucket/name", False for a path of this machine."""
    return "://" in place


class Place(Protocol):
    """A folder of whole files, by their names relative to it ("runs/1f8b.parquet")."""

    def put(self, name: str, content: bytes) -> None:
        """Write a file that is whole from the moment on that it is seen."""

    def get(self, name: str) -> bytes:
        """The content of a file."""

    def names(self, folder: str) -> list[str]:
        """Names of the Parquet files in a folder in it, sorted; none if the folder is not there."""

    def remove(self, name: str) -> None:
        """Take a file away; nothing happens if it has gone."""


class Folder:
    """A folder of this machine."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def put(self, name: str, content: bytes) -> None:
        """See `Place`."""
        (self.path / name).parent.mkdir(parents=True, exist_ok=True)
        write_whole(self.path / name, content)

    def get(self, name: str) -> bytes:
        """See `Place`."""
        return (self.path / name).read_bytes()

    def names(self, folder: str) -> list[str]:
        """See `Place`."""
        return sorted(f"{folder}/{path.name}" for path in (self.path / folder).glob("*.parquet") if path.name[0] != ".")

    def remove(self, name: str) -> None:
        """See `Place`."""
        (self.path / name).unlink(missing_ok=True)


class Bucket:
    """A folder of an object store, where a file appears as soon as all of it is there."""

    def __init__(self, address: str) -> None:
        self._files, self._root = _filesystem(address)

    def put(self, name: str, content: bytes) -> None:
        """See `Place`."""
        self._files.makedirs(f"{self._root}/{name}".rpartition("/")[0], exist_ok=True)
        self._files.pipe_file(f"{self._root}/{name}", content)

    def get(self, name: str) -> bytes:
        """See `Place`."""
        return bytes(self._files.cat_file(f"{self._root}/{name}"))

    def names(self, folder: str) -> list[str]:
        """See `Place`."""
        found = self._files.glob(f"{self._root}/{folder}/*.parquet")
        return sorted(f"{folder}/{path.rpartition('/')[2]}" for path in found)

    def remove(self, name: str) -> None:
        """See `Place`."""
        with contextlib.suppress(FileNotFoundError):
            self._files.rm_file(f"{self._root}/{name}")


def place_of(address: str) -> Place:
    """The place that a path or an address names."""
    return Bucket(address) if is_remote(address) else Folder(Path(address))


def files_of(pattern: str) -> list[str]:
    """The addresses behind a pattern of an object store, in the order of their names."""
    files, path = _filesystem(pattern)
    found = files.glob(path) if any(sign in path for sign in "*?[") else [path] if files.exists(path) else []
    return sorted(files.unstrip_protocol(each) for each in found)


@contextlib.contextmanager
def local(log: str) -> Iterator[Path]:
    """A log as a file of this machine: one of an object store is fetched, and let go of afterwards."""
    if not is_remote(log):
        yield Path(log)
        return
    files, path = _filesystem(log)
    with tempfile.TemporaryDirectory(prefix="explore3d-") as folder:
        copy = Path(folder) / path.rpartition("/")[2]
        with files.open(path, "rb", block_size=BLOCK_BYTES) as source, copy.open("wb") as target:
            shutil.copyfileobj(source, target, BLOCK_BYTES)
        yield copy


@contextlib.contextmanager
def open_at(address: str, near: int) -> Iterator[Any]:
    """A file of an object store or a web server, read by ranges: what is asked for and some bytes around it.

    Args:
        address: where it lies.
        near: bytes that are fetched together.

    Raises:
        UserError: it cannot be opened.
    """
    files, path = _filesystem(address)
    try:
        opened = files.open(path, "rb", block_size=near, cache_type="blockcache")
    except OSError as error:
        raise UserError(f"{address}: cannot be opened: {error.strerror or error}") from error
    with opened as file:
        yield file


def sha256_of(log: str) -> str:
    """Digest of a log's bytes, wherever it lies. Raises OSError."""
    if not is_remote(log):
        with Path(log).open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    files, path = _filesystem(log)
    digest = hashlib.sha256()
    with files.open(path, "rb", block_size=BLOCK_BYTES) as file:
        while block := file.read(BLOCK_BYTES):
            digest.update(block)
    return digest.hexdigest()


def _filesystem(address: str) -> tuple[Any, str]:
    """The file system of an address, and the path in it."""
    try:
        import fsspec
    except ImportError as error:
        raise UserError(
            f'{address}: is an address, which needs fsspec; install it: pip install "explore3d[cluster]"'
        ) from error
    try:
        files, path = fsspec.core.url_to_fs(address)
    except (ImportError, ValueError) as error:  # an unknown protocol, or one whose package is missing
        raise UserError(f"{address}: cannot be opened: {error}") from error
    return files, str(path).rstrip("/")
