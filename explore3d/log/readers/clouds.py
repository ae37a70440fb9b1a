"""Readers of point clouds whose points stand in the order of movement: PLY, PCD, OBJ; meshes are refused."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from explore3d import UserError
from explore3d.log.own import Log
from explore3d.log.readers.arrays import few_digits, numbers_log
from explore3d.log.readers.optional import claimed
from explore3d.log.readers.own import POINT, TIP

ORDER = "the order of movement (taken as the order of the points)"
_UNSAID = ("the units", ORDER, TIP, POINT)
_PLY_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
_MESH = "holds triangles, which have no order of movement; a global model is given with --model"
LONGEST_HEADER = 65536  # bytes of a header of words: a file without its end is none


class PlyPoints:
    """Vertices without faces, with all their scalar properties (t, sweep, nx ... are known by name)."""

    name = "points in a PLY file"
    unsaid: tuple[str, ...] = _UNSAID

    def sniff(self, first: bytes) -> float:
        return 1.0 if re.match(rb"ply\r?\n", first) else 0.0

    def read(self, path: Path, settings: Mapping[str, Any]) -> Log:
        data = path.read_bytes()
        header, body = _header(path, data, rb"end_header\r?\n")
        words = [line.split() for line in header.splitlines()]
        elements = [index for index, line in enumerate(words) if line[:1] == ["element"]]
        sizes = {words[index][1]: _whole(path, words[index][-1]) for index in elements if len(words[index]) == 3}
        if sizes.get("face") or sizes.get("tristrips"):
            raise UserError(f"{path}: {_MESH}")
        if not elements or words[elements[0]][1] != "vertex" or "vertex" not in sizes:
            raise UserError(f"{path}: is a PLY file whose first element is not vertex")
        stop = elements[1] if len(elements) > 1 else len(words)
        fields = [line[1:] for line in words[elements[0] + 1 : stop] if line[:1] == ["property"]]
        if not fields or any(len(field) != 2 or field[0] not in _PLY_TYPES for field in fields):
            raise UserError(f"{path}: is a PLY file whose vertices have properties that are no plain numbers")
        form = next((line[1] for line in words if line[:1] == ["format"] and len(line) > 1), "")
        order = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}.get(form)
        if order is None:
            raise UserError(f"{path}: is a PLY file of the unknown format {form!r}")
        names = [field[1] for field in fields]
        types = [order + _PLY_TYPES[field[0]] for field in fields]
        return _cloud_log(path, names, types, sizes["vertex"], body, form == "ascii", settings, "points of a PLY file")


class PcdPoints:
    """Points of the Point Cloud Library, in text, binary, or binary compressed by LZF."""

    name = "points in a PCD file"
    unsaid: tuple[str, ...] = _UNSAID

    def sniff(self, first: bytes) -> float:
        return 1.0 if re.search(rb"(?m)^VERSION \S+\r?\nFIELDS ", first) else 0.0

    def read(self, path: Path, settings: Mapping[str, Any]) -> Log:
        data = path.read_bytes()
        header, body = _header(path, data, rb"(?m)^DATA[^\n]*\n")
        said = {line.split()[0]: line.split()[1:] for line in header.splitlines() if line.split() and line[0] != "#"}
        try:
            names, kinds = said["FIELDS"], list(zip(said["TYPE"], said["SIZE"], strict=True))
            count, form = said["POINTS"][0], said["DATA"][0]
        except (KeyError, IndexError, ValueError) as error:
            raise UserError(f"{path}: is a PCD file whose header lacks FIELDS, TYPE, SIZE, POINTS or DATA") from error
        types = [f"<{kind.lower()}{size}" for kind, size in kinds]
        plain = all(re.fullmatch(r"<(f[48]|[iu][1248])", each) for each in types) and len(names) == len(types)
        if not plain or any(each != "1" for each in said.get("COUNT", [])):
            raise UserError(f"{path}: is a PCD file whose fields are no plain numbers")
        if form not in ("ascii", "binary", "binary_compressed"):
            raise UserError(f"{path}: is a PCD file with {form!r} data; possible: ascii, binary, binary_compressed")
        number, kind = _whole(path, count), "points of a PCD file"
        if form == "binary_compressed":
            columns = _unpacked_columns(path, body, types, number)
            return numbers_log(path, tuple(names), columns, settings, kind)
        return _cloud_log(path, names, types, number, body, form == "ascii", settings, kind)


def _unpacked_columns(path: Path, body: bytes, types: list[str], count: int) -> np.ndarray:
    """(N, C) numbers of a compressed PCD file: column after column in one block of LZF."""
    from explore3d.log.readers.lzf_kernels import unpack_lzf

    packed, size = (int.from_bytes(body[at : at + 4], "little") for at in (0, 4))
    if packed > len(body) - 8 or size != count * sum(np.dtype(each).itemsize for each in types):
        raise UserError(f"{path}: its header claims {packed} and {size} bytes for {count} points; it is cut or damaged")
    claimed(path, "a PCD file", size)
    out = np.empty(size, dtype=np.uint8)
    if unpack_lzf(np.frombuffer(body, np.uint8, packed, 8), out) != size:
        raise UserError(f"{path}: its compressed points are damaged")
    columns, at = [], 0
    for each in types:
        kind = np.dtype(each)
        columns.append(out[at : at + count * kind.itemsize].view(kind).astype(np.float64))
        at += count * kind.itemsize
    return np.column_stack(columns)


class ObjPoints:
    """Vertices of a Wavefront OBJ file without faces."""

    name = "points in an OBJ file"
    unsaid: tuple[str, ...] = _UNSAID

    def sniff(self, first: bytes) -> float:
        return 0.9 if re.search(rb"(?m)^v[ \t]+[-+.\d]", first) else 0.0

    def read(self, path: Path, settings: Mapping[str, Any]) -> Log:
        data = path.read_bytes()
        if re.search(rb"(?m)^f[ \t]", data):
            raise UserError(f"{path}: {_MESH}")
        lines = re.findall(rb"(?m)^v[ \t]+([^\r\n#]*)", data)
        body = b"\n".join(b" ".join(line.split()[:3]) for line in lines) + b"\n"
        return _cloud_log(path, ["x", "y", "z"], ["f8"] * 3, len(lines), body, True, settings, "points of an OBJ file")


class StlPoints:
    """Points that a program could only write as triangles: three equal corners each; a true mesh is refused."""

    name = "an STL file"
    unsaid: tuple[str, ...] = _UNSAID

    def sniff(self, first: bytes) -> float:
        if re.match(rb"\s*solid\b.*\s+facet normal", first, re.S):
            return 1.0
        # 80 bytes of anything, then the number of triangles: only believed if the rest reads like one
        if len(first) < 134 or b"\0" not in first[80:134]:
            return 0.0
        count = int.from_bytes(first[80:84], "little")
        normal = np.frombuffer(first[84:96], dtype="<f4")
        whole = 0 < count < 10**9 and first[132:134] == b"\0\0"
        return 0.5 if whole and np.isfinite(normal).all() and float(np.abs(normal).max()) <= 1.001 else 0.0

    def read(self, path: Path, settings: Mapping[str, Any]) -> Log:
        data = path.read_bytes()
        words = bool(re.match(rb"\s*solid\b.*\s+facet normal", data[:LONGEST_HEADER], re.S))
        if words:
            lines = re.findall(rb"(?m)^[ \t]*vertex[ \t]+([^\r\n]*)", data)
            if len(lines) % 3 or len(lines) // 3 != len(re.findall(rb"(?m)^[ \t]*endfacet", data)):
                raise UserError(f"{path}: is an STL file whose facets have no three corners each; it is cut or damaged")
            corners = _parsed(path, lines, 3).reshape(-1, 3, 3)
        else:
            count = int.from_bytes(data[80:84], "little")
            if len(data) < 84 + 50 * count:
                raise UserError(
                    f"{path}: its header claims {count} facets, for which its {len(data)} bytes are too few; it is cut"
                )
            facet = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
            corners = np.frombuffer(data, facet, count, 84)["corners"].astype(np.float64)
        if not (corners == corners[:, :1]).all():
            raise UserError(f"{path}: {_MESH}")
        said = [] if words else few_digits(["<f4"])
        return numbers_log(path, ("x", "y", "z"), corners[:, 0], settings, "points of an STL file", said)


def _header(path: Path, data: bytes, end: bytes) -> tuple[str, bytes]:
    hit = re.search(end, data[:LONGEST_HEADER])
    if hit is None:
        raise UserError(f"{path}: its header has no end; the file is cut or damaged")
    return data[: hit.end()].decode("latin-1"), data[hit.end() :]


def _whole(path: Path, word: str) -> int:
    if not word.isdecimal():
        raise UserError(f"{path}: its header states {word[:20]!r} points; expected a whole number")
    return int(word)


def _cloud_log(
    path: Path,
    names: list[str],
    types: list[str],
    count: int,
    body: bytes,
    text: bool,
    settings: Mapping[str, Any],
    kind: str,
) -> Log:
    """The log of `count` points, if the file is long enough to hold them: what its header claims takes no memory."""
    if len(set(names)) != len(names):
        raise UserError(f"{path}: field columns: two properties have one name: {', '.join(names)}")
    least = 2 * len(names) if text else np.dtype(",".join(types) + ",").itemsize
    if count * least > len(body) + 1:
        raise UserError(
            f"{path}: its header claims {count} points, for which its {len(body)} bytes are too few; it is cut"
        )
    if text:
        rows = _parsed(path, body.splitlines()[:count], len(names))
        if len(rows) != count:
            raise UserError(f"{path}: expected {count} points; found {len(rows)}; it is cut")
    else:
        points = np.frombuffer(body, dtype=list(zip(names, types, strict=True)), count=count)
        rows = np.column_stack([points[name].astype(np.float64) for name in names])
    return numbers_log(path, tuple(names), rows, settings, kind, [] if text else few_digits(types))


def _parsed(path: Path, lines: list[bytes], columns: int) -> np.ndarray:
    """(N, columns) numbers of lines of words."""
    words = [line.split() for line in lines if line.strip()]
    if any(len(line) != columns for line in words):
        raise UserError(
            f"{path}: expected {columns} numbers for each point; found another number; it is cut or damaged"
        )
    try:
        return np.array(words, dtype=np.float64).reshape(-1, columns)
    except ValueError as error:
        raise UserError(f"{path}: {str(error).splitlines()[0]}") from error
