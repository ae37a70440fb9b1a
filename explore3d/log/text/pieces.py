"""read_pieces: a table piece by piece, in memory that does not grow with the file."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from explore3d import UserError
from explore3d.log.text.decode import as_lines
from explore3d.log.text.read import Reading, TableText, dialect_of

TEXT_PIECE = 32 * 2**20  # bytes: 2e6 rows of two columns; its numbers and what is made of them take some 150 MB


def read_pieces(path: Path, decimal: str | None = None, size: int = TEXT_PIECE) -> Iterator[TableText]:
    """The pieces of a table, each with the header that stands at its beginning.

    Args:
        path: the file, in UTF-8 or Latin-1.
        decimal: its decimal sign, if the file leaves it open.
        size: bytes of a piece; it ends with a line.

    Raises:
        UserError: as read_text; or text of another encoding.
    """
    head, rest, dialect, lines = b"", b"", None, 0
    with path.open("rb") as file:
        while block := file.read(size):
            if b"\0" in block:
                raise UserError(f"{path}: expected text in UTF-8, to be read in pieces; found UTF-16 or no text")
            block = rest + block
            cut = len(block) if len(block) < size else block.rfind(b"\n") + 1
            block, rest = block[:cut], block[cut:]
            if not block or block.isspace():
                continue
            data = as_lines(path, block)
            whole = data.endswith(b"\n")
            data = data if whole else data + b"\n"
            dialect = dialect or dialect_of(path, data, decimal)
            reading = Reading(path, head + data, whole, dialect, decimal, lines - head.count(b"\n"))
            yield reading.table()
            lines += block.count(b"\n")
            head = head or data[: reading.start]
        if rest.strip():
            data = as_lines(path, rest)
            assert dialect is not None
            yield Reading(path, head + data + b"\n", False, dialect, decimal, lines - head.count(b"\n")).table()
