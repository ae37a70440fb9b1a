"""Reader: what every reader of a kind of file offers, ours and those of other packages."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

from explore3d.log.own import Log
from mapping import Trace

FIRST_BYTES = 4096  # bytes that a reader sees of a file before it says how sure it is


class Reader(Protocol):
    """A kind of file.

    A package offers one by an entry point of the group `explore3d.readers` that names an object with these four.

    Attributes:
        name: what the files are, "a table of numbers".
        unsaid: what such a file does not say, each in a few words.
    """

    name: str
    unsaid: tuple[str, ...]

    def sniff(self, first: bytes) -> float:
        """How sure it is, from 0 to 1, that a file that begins so (at most FIRST_BYTES) is of this kind."""
        ...

    def read(self, path: Path, settings: Mapping[str, Any]) -> Log | Trace:
        """What was recorded; settings are those of read_table, those that nobody said left out.

        Raises:
            UserError: one line naming the file and the field.
        """
        ...
