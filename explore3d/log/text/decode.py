"""What bytes a text file of an instrument holds: its encoding, its line ends, its signs, as plain UTF-8."""

from __future__ import annotations

import re
from pathlib import Path

from explore3d import UserError

_MAGIC = {
    b"\x89PNG": "a PNG image",
    b"\xff\xd8\xff": "a JPEG image",
    b"GIF8": "a GIF image",
    b"%PDF": "a PDF document",
    b"PK\x03\x04": "a ZIP archive (a spreadsheet? export it as CSV)",
    b"\x1f\x8b": "a gzip archive (unpack it first)",
    b"\x28\xb5\x2f\xfd": "a zstd archive (unpack it first)",
    b"\x89HDF": "an HDF5 file",
    b"PAR1": "a Parquet file",
    b"\x7fELF": "a program",
    b"\x89MCAP": "an MCAP log, but its beginning is damaged",
    b"\xd0\xcf\x11\xe0": "an old Excel or Word file (export it as CSV)",
    b"SQLite format 3": "an SQLite database",
    b"\x80\x04\x95": "a pickle, which could run programs and is never opened",
}
_MARKS = {b"\xff\xfe\0\0": "utf-32", b"\0\0\xfe\xff": "utf-32", b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}
# Signs that mean what an ASCII one means: minus, and blanks between the thousands of a number
_MINUS = str.maketrans({"\u2212": "-", "\u2013": "-", "\ufe63": "-", "\uff0d": "-", "\u2019": "'"})
_BLANK_IN_NUMBER = re.compile("(?<=\\d)[\u00a0\u202f\u2009\u2007](?=\\d{3})")


def decoded(path: Path) -> bytes:
    """The file as UTF-8 with lines that end in a newline; the last one may lack it.

    Raises:
        UserError: no such file, empty, or not text.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UserError(f"{path}: cannot read it: {error.strerror}") from error
    return as_lines(path, data)


def as_lines(path: Path, data: bytes) -> bytes:
    """The same of bytes that were read of the file."""
    if not data or data.isspace():
        raise UserError(f"{path}: is empty")
    for magic, what in _MAGIC.items():
        if data.startswith(magic):
            raise UserError(f"{path}: is {what}; expected a log (.mcap) or a table of numbers (CSV, TXT)")
    data = _utf8(path, data)
    if b"\r" in data and b"\n" not in data:
        data = data.replace(b"\r", b"\n")
    if not data.isascii():
        text = _BLANK_IN_NUMBER.sub("", data.decode().translate(_MINUS))
        data = re.sub("[\u00a0\u202f\u2009\u2007]", " ", text).encode()
    return data


def _utf8(path: Path, data: bytes) -> bytes:
    for mark, name in _MARKS.items():
        if data.startswith(mark):
            return data.decode(name, errors="replace").lstrip("\ufeff").encode()
    if b"\0" in data:
        even, odd = data[0:4000:2].count(0), data[1:4000:2].count(0)
        few = min(even, odd) == 0 and max(even, odd) > 0.4 * len(data[:4000]) / 2
        if not few:  # UTF-16 without a mark has a zero in every other byte
            raise UserError(f"{path}: is a binary file; expected a log (.mcap) or a table of numbers (CSV, TXT)")
        return data.decode("utf-16-le" if odd else "utf-16-be", errors="replace").encode()
    if data.isascii():
        return data
    data = data.removeprefix(b"\xef\xbb\xbf")
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("latin-1").encode()  # instruments write "µm" so
    return data
