"""Libraries that not everybody needs: the command that installs one, and what it stumbles over, in one line."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from explore3d import UserError
from explore3d.log.readers.packed import ALWAYS_UNPACKED, MOST_UNPACKED, MOST_UNPACKING_RATIO


def library(path: Path, module: str, extra: str, kind: str) -> Any:
    """A module of another package.

    Args:
        path: the file that needs it.
        extra: the group of optional packages that it belongs to.
        kind: what the file is, "a ROS bag".

    Raises:
        UserError: it is not installed; one line with the command that installs it.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise UserError(
            f"{path}: is {kind}, which is read by the package {module.partition('.')[0]}; install it: "
            f'pip install "explore3d[{extra}]"'
        ) from error


@contextmanager
def decoding(path: Path, kind: str) -> Iterator[None]:
    """Whatever a library stumbles over in a damaged file becomes one line; its warnings are no business of users."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except UserError:
        raise
    except Exception as error:  # parsers of binary formats raise whatever a wrong byte leads them to
        words = " ".join(str(error).split()) or type(error).__name__
        raise UserError(f"{path}: is {kind} that cannot be read, damaged or cut: {words[:160]}") from error


def claimed(path: Path, kind: str, size: int, packed: int | None = None) -> None:
    """Refuse a file whose header claims more bytes than it can hold, before memory is taken.

    Args:
        size: bytes that the header claims.
        packed: bytes that they are packed in; None: the whole file.

    Raises:
        UserError: naming both.
    """
    have = path.stat().st_size if packed is None else packed
    if size < 0 or size > MOST_UNPACKED or size > max(ALWAYS_UNPACKED, MOST_UNPACKING_RATIO * have):
        raise UserError(f"{path}: is {kind} whose header claims {size:,} bytes, which its {have:,} cannot hold")
