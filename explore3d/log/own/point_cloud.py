"""Batches of samples as foxglove.PointCloud messages in protobuf, written by hand.

The message is one fixed prefix and one block of packed little-endian samples, so that fifty lines do
what a generated module and its runtime would: float64 survive bit for bit, any MCAP viewer draws the cloud.

Reference:
    https://protobuf.dev/programming-guides/encoding (the wire format) and foxglove/PointCloud.proto.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from explore3d import PointCloudError

SCHEMA_NAME = "foxglove.PointCloud"

# proto.NumericType of foxglove/PackedElementField.proto
_NUMERIC = {"u1": 1, "i1": 2, "<u2": 3, "<i2": 4, "<u4": 5, "<i4": 6, "<f4": 7, "<f8": 8}
_DTYPE = {number: name for name, number in _NUMERIC.items()}
_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5


def encode_prefix(dtype: np.dtype[np.void], frame: str) -> bytes:
    """Frame, identity pose, stride and fields: the part that every message of one dtype shares."""
    quaternion = _field(4, struct.pack("<d", 1.0), _FIXED64)
    parts = [
        _field(2, frame.encode()),
        _field(3, _field(1, b"") + _field(2, quaternion)),
        _field(4, struct.pack("<I", dtype.itemsize), _FIXED32),
    ]
    assert dtype.names is not None
    for name in dtype.names:
        kind, offset = _offset(dtype, name)
        fields = [_field(1, name.encode()), _field(2, struct.pack("<I", offset), _FIXED32)]
        parts.append(_field(5, b"".join([*fields, _field(3, _varint(_NUMERIC[kind]), _VARINT)])))
    return b"".join(parts)


def encode(samples: NDArray[np.void], prefix: bytes, time_ns: int) -> bytes:
    """One message: `samples` (N,) structured as in `prefix`, stamped `time_ns` >= 0 nanoseconds."""
    seconds, nanos = divmod(time_ns, 1_000_000_000)
    stamp = _field(1, _varint(seconds), _VARINT) + _field(2, _varint(nanos), _VARINT)
    return b"".join([_field(1, stamp), prefix, _field(6, samples.tobytes())])


def decode(message: bytes) -> NDArray[np.void]:
    """The samples (N,) of a message, structured by the message's own fields; a read-only view.

    Raises:
        PointCloudError: the bytes are no such message.
    """
    try:
        entries = list(_entries(message))
        last = dict(entries)
        dtype = _layout(tuple(value for number, value in entries if number == 5), last[4])
        return np.frombuffer(last.get(6, b""), dtype=dtype)
    except (KeyError, ValueError, IndexError, TypeError, AttributeError, struct.error) as error:
        raise PointCloudError(f"these {len(message)} bytes are not a {SCHEMA_NAME} message: {error}") from error


@lru_cache(maxsize=16)
def _layout(fields: tuple[bytes, ...], stride: bytes) -> np.dtype[np.void]:
    """The dtype that a message's fields describe; the messages of a log share one."""
    read = [dict(_entries(value)) for value in fields]
    return np.dtype(
        {
            "names": [field[1].decode() for field in read],
            "formats": [_DTYPE[field[3]] for field in read],
            "offsets": [struct.unpack("<I", field.get(2, bytes(4)))[0] for field in read],
            "itemsize": struct.unpack("<I", stride)[0],
        }
    )


def descriptor_set() -> bytes:
    """The FileDescriptorSet that MCAP stores as the schema, so that any reader can decode the messages."""
    timestamp = _message("Timestamp", [("seconds", 1, "int64"), ("nanos", 2, "int32")])
    numeric = ["UNKNOWN", "UINT8", "INT8", "UINT16", "INT16", "UINT32", "INT32", "FLOAT32", "FLOAT64"]
    values = b"".join(
        _field(2, _field(1, name.encode()) + _field(2, _varint(number), _VARINT)) for number, name in enumerate(numeric)
    )
    element = _message(
        "PackedElementField",
        [("name", 1, "string"), ("offset", 2, "fixed32"), ("type", 3, ".foxglove.PackedElementField.NumericType")],
        enum=_field(1, b"NumericType") + values,
    )
    vector = _message("Vector3", [(axis, number, "double") for number, axis in enumerate("xyz", 1)])
    quaternion = _message("Quaternion", [(axis, number, "double") for number, axis in enumerate("xyzw", 1)])
    pose = _message("Pose", [("position", 1, ".foxglove.Vector3"), ("orientation", 2, ".foxglove.Quaternion")])
    cloud = _message(
        "PointCloud",
        [
            ("timestamp", 1, ".google.protobuf.Timestamp"),
            ("frame_id", 2, "string"),
            ("pose", 3, ".foxglove.Pose"),
            ("point_stride", 4, "fixed32"),
            ("fields", 5, "*.foxglove.PackedElementField"),
            ("data", 6, "bytes"),
        ],
    )
    stamp_file = "google/protobuf/timestamp.proto"
    return _file(stamp_file, "google.protobuf", [timestamp]) + _file(
        "foxglove/PointCloud.proto", "foxglove", [vector, quaternion, pose, element, cloud], stamp_file
    )


# --- the wire format -------------------------------------------------------------------------------------


def _varint(number: int) -> bytes:
    out = bytearray()
    while number > 0x7F:
        out.append(number & 0x7F | 0x80)
        number >>= 7
    out.append(number)
    return bytes(out)


def _field(number: int, payload: bytes, wire: int = _BYTES) -> bytes:
    head = _varint(number << 3 | wire)
    return head + _varint(len(payload)) + payload if wire == _BYTES else head + payload


def _read_varint(message: bytes, at: int) -> tuple[int, int]:
    number = shift = 0
    while True:
        byte = message[at]
        number |= (byte & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if byte < 0x80:
            return number, at


def _entries(message: bytes) -> Iterator[tuple[int, Any]]:
    """(field number, value) of each field; varints as int, everything else as bytes."""
    at = 0
    while at < len(message):
        key, at = _read_varint(message, at)
        number, wire = key >> 3, key & 7
        if wire == _VARINT:
            value, at = _read_varint(message, at)
            yield number, value
            continue
        if wire == _BYTES:
            size, at = _read_varint(message, at)
        elif wire in (_FIXED64, _FIXED32):
            size = 8 if wire == _FIXED64 else 4
        else:
            raise ValueError(f"wire type {wire}")
        if at + size > len(message):
            raise ValueError("ends in the middle of a field")
        yield number, message[at : at + size]
        at += size


def _offset(dtype: np.dtype[np.void], name: str) -> tuple[str, int]:
    assert dtype.fields is not None
    kind, offset = dtype.fields[name][:2]
    return kind.str.lstrip("|"), offset


# --- the schema ------------------------------------------------------------------------------------------

_SCALAR = {"double": 1, "int64": 3, "int32": 5, "fixed32": 7, "string": 9, "bytes": 12}
_MESSAGE, _ENUM = 11, 14


def _message(name: str, fields: list[tuple[str, int, str]], enum: bytes = b"") -> bytes:
    """A DescriptorProto; a type that begins with a dot is a message (or the enum), with a star it is repeated."""
    parts = [_field(1, name.encode())]
    for label, number, kind in fields:
        repeated, kind = kind.startswith("*"), kind.lstrip("*")
        code = _SCALAR.get(kind) or (_ENUM if kind.endswith("NumericType") else _MESSAGE)
        entry = _field(1, label.encode()) + _field(3, _varint(number), _VARINT)
        entry += _field(4, _varint(3 if repeated else 1), _VARINT) + _field(5, _varint(code), _VARINT)
        parts.append(_field(2, entry + (_field(6, kind.encode()) if kind.startswith(".") else b"")))
    return b"".join(parts) + (_field(4, enum) if enum else b"")


def _file(name: str, package: str, messages: list[bytes], needs: str = "") -> bytes:
    parts = [_field(1, name.encode()), _field(2, package.encode())]
    parts += [_field(3, needs.encode())] if needs else []
    parts += [_field(4, message) for message in messages]
    return _field(1, b"".join([*parts, _field(12, b"proto3")]))
