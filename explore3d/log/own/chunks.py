"""Intact chunks of an MCAP file, however the file was cut or damaged.

The framing of a damaged file cannot be followed: one wrong length and all that comes after is misread. So the
chunks are found by what stands in their header, and a chunk counts only if its checksum agrees. Every sample
lies in such a chunk: a wrong sample cannot come out, and one damaged chunk costs no other.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.records import Chunk, McapRecord
from mcap.stream_reader import breakup_chunk

from explore3d.log.own.format import LARGEST_RECORD

# opcode, record length, first time, last time, uncompressed size, checksum; then the name of the compression
_HEADER = struct.Struct("<BQQQQI")
_COMPRESSION = re.compile(rb"\x04\0\0\0zstd|\x03\0\0\0lz4")
# Bytes that are searched at once: at first few, for the next chunk mostly follows a short index of the one before
_FIRST_BLOCK, _BLOCK = 1 << 10, 1 << 16


@dataclass
class Damage:
    """What the search met: `damaged` chunks whose checksum disagrees, `cut` True if the last one is incomplete, and
    `end`, the place behind the last intact one."""

    damaged: int = 0
    cut: bool = False
    end: int = 0


def intact_chunks(file: BinaryIO, damage: Damage, at: int = 0) -> Iterator[list[McapRecord]]:
    """The schemas, channels and messages of each intact chunk from `at` on, in order; notes the rest in `damage`."""
    while (start := _next_header(file, at)) is not None:
        chunk, end = _read_chunk(file, start, damage)
        if chunk is not None:
            damage.end = end
            yield chunk
        at = end


def _next_header(file: BinaryIO, at: int) -> int | None:
    """Position of the next thing that looks like a chunk at or after `at`."""
    size = _FIRST_BLOCK
    while True:
        file.seek(at)
        block = file.read(size)
        for hit in _COMPRESSION.finditer(block, _HEADER.size):
            if block[hit.start() - _HEADER.size] == Opcode.CHUNK:
                return at + hit.start() - _HEADER.size
        if len(block) < size:
            return None
        at, size = at + len(block) - _HEADER.size - 8, min(8 * size, _BLOCK)


def _read_chunk(file: BinaryIO, start: int, damage: Damage) -> tuple[list[McapRecord] | None, int]:
    """The records of the chunk at `start` and where to search on."""
    file.seek(start)
    _, length, first, last, size, checksum = _HEADER.unpack(file.read(_HEADER.size))
    beyond = start + _HEADER.size
    name_size = struct.unpack("<I", file.read(4))[0]
    compression = file.read(name_size).decode()
    stated = file.read(8)
    expected = length - (_HEADER.size - 9) - 4 - name_size - 8
    if len(stated) < 8:
        damage.cut = True
        return None, beyond
    if max(length, size) > LARGEST_RECORD or struct.unpack("<Q", stated)[0] != expected:
        damage.damaged += 1
        return None, beyond
    data = file.read(expected)
    if len(data) < expected:
        damage.cut = True
        return None, beyond
    records = _unpack(Chunk(compression, data, last, first, checksum, size))
    if records is None:
        damage.damaged += 1
        return None, beyond
    return records, start + 9 + length


def _unpack(chunk: Chunk) -> list[McapRecord] | None:
    """The records of a chunk, or None if its bytes are not what was written."""
    import zstandard

    try:
        # a damaged size must not make the decompressor allocate what it claims
        if chunk.compression == "zstd" and zstandard.frame_content_size(chunk.data) != chunk.uncompressed_size:
            return None
        if chunk.uncompressed_crc == 0:  # "no checksum": nothing vouches for these samples
            return None
        records: list[McapRecord] = breakup_chunk(chunk, validate_crc=True)
    except (zstandard.ZstdError, RuntimeError, ValueError, EOFError):
        return None
    return records
