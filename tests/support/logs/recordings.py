"""One recording, rows of a raster over a plate with a crest, written in the forms in which people keep such data."""

from __future__ import annotations

import csv
import gzip
import io
import json
import struct
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from explore3d.log import LogWriter
from hw import Move
from mapping import Trace

RADIUS = 1.0  # mm
PITCH, ROWS_APART = 0.02, 0.5  # mm


@dataclass(frozen=True)
class Raster:
    """Rows along x, all lengths in mm; a crest of 0.05 mm lies across the rows.

    Args:
        rows, columns: how many.
        points: (rows * columns, 3) centres of the ball.
    """

    rows: int
    columns: int
    points: np.ndarray

    @property
    def x(self) -> np.ndarray:
        return self.points[:, 0]

    @property
    def heights(self) -> np.ndarray:
        """(rows, columns)."""
        return self.points[:, 2].reshape(self.rows, self.columns)

    @property
    def t(self) -> np.ndarray:
        """(N,) seconds."""
        return 1e-3 * np.arange(len(self.points))

    @property
    def sweep(self) -> np.ndarray:
        return np.repeat(np.arange(self.rows), self.columns)


def raster(rows: int, columns: int, seed: int = 31) -> Raster:
    """A raster whose places are exact decimals and whose heights have noise of 1 um."""
    x, y = np.round(PITCH * np.arange(columns), 6), np.round(ROWS_APART * np.arange(rows), 6)
    along, across = np.tile(x, rows), np.repeat(y, columns)
    off = along - 0.5 * x[-1]
    crest = np.maximum(0.0, 0.05 - off**2 / (2.0 * (RADIUS + 0.1)))
    z = RADIUS + crest + np.random.default_rng(seed).normal(0.0, 1e-3, len(along))
    return Raster(rows, columns, np.column_stack([along, across, np.round(z, 6)]))


@dataclass(frozen=True)
class Form:
    """A form: what writes it, and what the user must say to have it read.

    Args:
        write: (raster, path) -> settings.
        needs: module that it takes to write or read it, "" for none.
        step: of the numbers that it can keep, mm: what is read may differ by so much.
    """

    write: Callable[[Raster, Path], dict[str, Any]]
    needs: str = ""
    step: float = 0.0


FORMS: dict[str, Form] = {}
MM: dict[str, Any] = {"units": "mm"}


def form(name: str, needs: str = "", step: float = 0.0) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    def keep(write: Callable[[Raster, Path], dict[str, Any] | None]) -> Callable[..., Any]:
        FORMS[name] = Form(lambda log, path: write(log, path) or {}, needs, step)
        return write

    return keep


def as_text(
    log: Raster, delimiter: str = ",", header: str = "x,y,z", scale: float = 1.0, comma: bool = False, digits: int = 9
) -> str:
    lines = [delimiter.join(f"{scale * value:.{digits}f}" for value in row) for row in log.points]
    body = "\n".join(lines)
    head = delimiter.join(header.split(",")) + "\n" if header else ""
    return head + (body.replace(".", ",") if comma else body) + "\n"


def add_texts() -> None:
    def text(name: str, step: float = 0.0, coding: str = "utf-8", settings: Any = None, **how: Any) -> None:
        form(name, step=step)(
            lambda log, path: (
                path.write_bytes(as_text(log, **how).encode(coding)) and (MM if settings is None else settings)
            )
        )

    text("CSV")
    text("CSV, semicolons and decimal commas", delimiter=";", comma=True)
    text("CSV, tabs", delimiter="\t")
    text("text in blanks, without header", delimiter=" ", header="")
    text("CSV in UTF-16", coding="utf-16")
    text("CSV in um, stated", header="x [um],y [um],z [um]", scale=1e3, settings={})
    text("CSV in m, stated", header="x/m,y/m,z/m", scale=1e-3, digits=12, settings={})
    text("CSV in inch, stated", header="x (in),y (in),z (in)", scale=1 / 25.4, digits=12, settings={}, step=1e-9)
    text("CSV with CR LF", delimiter=";")


add_texts()


@form("CSV in gzip")
def _(log: Raster, path: Path) -> dict[str, Any]:
    path.write_bytes(gzip.compress(as_text(log).encode()))
    return MM


@form("CSV in ZIP")
def _(log: Raster, path: Path) -> dict[str, Any]:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("scan.csv", as_text(log))
    return MM


def _own(log: Raster, path: Path) -> dict[str, Any]:
    with LogWriter(path, tip_radius=1e-3 * RADIUS) as writer:
        for sweep in range(log.rows):
            row = slice(sweep * log.columns, (sweep + 1) * log.columns)
            points = 1e-3 * log.points[row]
            trace = Trace(log.t[row], points, np.full(log.columns, sweep), 1e-3 * RADIUS)
            writer.write(Move(points[[0, -1]], [0.0, 0.0, -1.0], speed=0.02, force=1.0), trace)
    return {}


form("our MCAP")(_own)


def _npy(array: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


FIELDS = [("x", "<f8"), ("y", "<f8"), ("z", "<f8")]
form("NPY")(lambda log, path: path.write_bytes(_npy(log.points)) and MM)
form("NPY in Fortran order")(lambda log, path: path.write_bytes(_npy(np.asfortranarray(log.points))) and MM)
form("NPY of float32", step=1e-5)(lambda log, path: path.write_bytes(_npy(log.points.astype("f4"))) and MM)
form("NPY of fields")(
    lambda log, path: path.write_bytes(_npy(np.array([tuple(row) for row in log.points], dtype=FIELDS))) and MM
)
form("NPY, map of heights")(
    lambda log, path: path.write_bytes(_npy(log.heights)) and MM | {"pixel": f"{PITCH} mm, {ROWS_APART} mm"}
)


def _npz(path: Path, **arrays: np.ndarray) -> dict[str, Any]:
    with path.open("wb") as file:
        np.savez_compressed(file, **arrays)
    return MM


form("NPZ of one array")(lambda log, path: _npz(path, points=log.points))
form("NPZ of columns")(lambda log, path: _npz(path, x=log.x, y=log.points[:, 1], z=log.points[:, 2], t=log.t))


def _words(log: Raster) -> bytes:
    return as_text(log, " ", "").encode()


def _ply(log: Raster, kind: str) -> bytes:
    head = f"ply\nformat {kind} 1.0\nelement vertex {len(log.points)}\n"
    head += "".join(f"property double {axis}\n" for axis in "xyz") + "end_header\n"
    return head.encode() + (
        _words(log) if kind == "ascii" else log.points.astype(">f8" if "big" in kind else "<f8").tobytes()
    )


for _kind in ("ascii", "binary_little_endian", "binary_big_endian"):
    form(f"PLY, {_kind}")(lambda log, path, kind=_kind: path.write_bytes(_ply(log, kind)) and MM)


def literal_lzf(data: bytes) -> bytes:
    """LZF that copies nothing: runs of literals alone."""
    return b"".join(bytes([len(data[at : at + 32]) - 1]) + data[at : at + 32] for at in range(0, len(data), 32))


def _pcd(log: Raster, kind: str) -> bytes:
    count = len(log.points)
    head = f"# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {count}\nHEIGHT 1\n"
    head += f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {count}\nDATA {kind}\n"
    if kind == "ascii":
        return head.encode() + _words(log)
    if kind == "binary":
        return head.encode() + log.points.tobytes()
    columns = np.ascontiguousarray(log.points.T).tobytes()
    packed = literal_lzf(columns)
    return head.encode() + struct.pack("<II", len(packed), len(columns)) + packed


for _kind in ("ascii", "binary", "binary_compressed"):
    form(f"PCD, {_kind}")(lambda log, path, kind=_kind: path.write_bytes(_pcd(log, kind)) and MM)


@form("OBJ")
def _(log: Raster, path: Path) -> dict[str, Any]:
    path.write_text("".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in log.points.tolist()))
    return MM


@form("STL, binary", step=1e-5)
def _(log: Raster, path: Path) -> dict[str, Any]:
    facet = np.zeros(len(log.points), np.dtype([("n", "<f4", 3), ("c", "<f4", (3, 3)), ("a", "<u2")]))
    facet["n"], facet["c"] = (0, 0, 1), log.points[:, None]
    path.write_bytes(bytes(80) + struct.pack("<I", len(facet)) + facet.tobytes())
    return MM


@form("STL, text")
def _(log: Raster, path: Path) -> dict[str, Any]:
    corner = [f"vertex {x!r} {y!r} {z!r}\n" for x, y, z in log.points.tolist()]
    facets = "".join(f"facet normal 0 0 1\nouter loop\n{line * 3}endloop\nendfacet\n" for line in corner)
    path.write_text(f"solid points\n{facets}endsolid points\n")
    return MM


def _las(log: Raster, path: Path, packed: bool, step: float) -> dict[str, Any]:
    import laspy

    header = laspy.LasHeader(point_format=1, version="1.2")
    header.scales, header.offsets = np.full(3, step), np.zeros(3)
    las = laspy.LasData(header)
    las.x, las.y, las.z = log.points.T
    las.gps_time, las.point_source_id = log.t, log.sweep.astype(np.uint16)
    file = io.BytesIO()
    las.write(file, do_compress=packed, laz_backend=laspy.LazBackend.Lazrs if packed else None)
    path.write_bytes(file.getvalue())
    return MM


form("LAS", "laspy", 1e-6)(lambda log, path: _las(log, path, False, 1e-6))
form("LAS of a coarse grid", "laspy", 1e-5)(lambda log, path: _las(log, path, False, 1e-5))
form("LAZ", "lazrs", 1e-6)(lambda log, path: _las(log, path, True, 1e-6))


def _parquet(log: Raster, path: Path, compression: str) -> dict[str, Any]:
    import pyarrow
    import pyarrow.parquet

    columns = {f"{axis}_mm": log.points[:, k] for k, axis in enumerate("xyz")} | {"t": log.t, "sweep": log.sweep}
    pyarrow.parquet.write_table(pyarrow.table(columns), path, compression=compression)
    return {}


for _kind in ("none", "snappy", "zstd"):
    form(f"Parquet, {_kind}", "pyarrow")(lambda log, path, kind=_kind: _parquet(log, path, kind))


@form("XLSX", "openpyxl")
def _(log: Raster, path: Path) -> dict[str, Any]:
    import openpyxl

    book = openpyxl.Workbook(write_only=True)
    sheet = book.create_sheet("scan")
    sheet.append(["x [mm]", "y [mm]", "z [mm]"])
    for row in log.points.tolist():
        sheet.append(row)
    book.save(path)
    return {}


def _x3p(log: Raster, path: Path, points: bool) -> dict[str, Any]:
    import x3pio

    file = io.BytesIO()
    if points:
        x3pio.write_points(file, 1e-3 * log.points)
    else:
        x3pio.write(file, 1e-3 * log.heights, x_scale=1e-3 * PITCH, y_scale=1e-3 * ROWS_APART)
    path.write_bytes(file.getvalue())
    return {}


form("X3P, map", "x3pio")(lambda log, path: _x3p(log, path, False))
form("X3P, points", "x3pio")(lambda log, path: _x3p(log, path, True))


@form("GWY", "SurfaceTopography")
def _(log: Raster, path: Path) -> dict[str, Any]:
    from SurfaceTopography import Topography
    from SurfaceTopography.IO.GWY import write_gwy

    size = (PITCH * log.columns, ROWS_APART * log.rows)
    file = io.BytesIO()
    write_gwy(Topography(log.heights.T, physical_sizes=size, unit="mm"), file)
    path.write_bytes(file.getvalue())
    return {}


def sdf_head(log: Raster, kind: str) -> dict[str, Any]:
    return {
        "ManufacID": "none", "CreateDate": "010120260000", "ModDate": "010120260000", "NumPoints": log.columns,
        "NumProfiles": log.rows, "Xscale": 1e-3 * PITCH, "Yscale": 1e-3 * ROWS_APART, "Zscale": 1e-3,
        "Zresolution": -1, "Compression": 0, "DataType": 7, "CheckType": 0,
    }  # fmt: skip


@form("SDF, text", "SurfaceTopography")
def _(log: Raster, path: Path) -> dict[str, Any]:
    head = "".join(f"{key} = {value}\n" for key, value in sdf_head(log, "a").items())
    body = "\n".join(" ".join(map(repr, row)) for row in log.heights.tolist())
    path.write_text(f"aISO-1.0\n{head}*\n{body}\n*\n")
    return {}


@form("SDF, binary", "SurfaceTopography")
def _(log: Raster, path: Path) -> dict[str, Any]:
    head = struct.pack(
        "<8s10s12s12sHHddddBBB", b"bISO-1.0", b"none", b"010120260000", b"010120260000", log.columns, log.rows,
        1e-3 * PITCH, 1e-3 * ROWS_APART, 1e-3, -1.0, 0, 7, 0,
    )  # fmt: skip
    path.write_bytes(head + log.heights.astype("<f8").tobytes())
    return {}


@form("text, map of heights")
def _(log: Raster, path: Path) -> dict[str, Any]:
    path.write_text("\n".join("\t".join(f"{z:.9f}" for z in row) for row in log.heights) + "\n")
    return MM | {"pixel": (f"{PITCH} mm", f"{ROWS_APART} mm")}


@form("RepRap height map", step=1e-6)
def _(log: Raster, path: Path) -> dict[str, Any]:
    x, y = log.points[-1, :2]
    rows = "\n".join(", ".join(f"{z:.6f}" for z in row) for row in log.heights)
    path.write_text(
        "RepRapFirmware height map file v2 generated at 2026-01-01 00:00, min error 0.0, max error 1.0\n"
        "axis0,axis1,min0,max0,min1,max1,radius,spacing0,spacing1,num0,num1\n"
        f"X,Y,0.00,{x:.2f},0.00,{y:.2f},-1.00,{PITCH:.2f},{ROWS_APART:.2f},{log.columns},{log.rows}\n{rows}\n"
    )
    return {}


@form("bCNC probe file")
def _(log: Raster, path: Path) -> dict[str, Any]:
    x, y = log.points[-1, :2]
    head = f"0 {x:.12g} {log.columns}\n0 {y:.12g} {log.rows}\n-10 10 100\n\n\n"
    lines = [f"{a:.12g} {b:.12g} {c:.12g}\n" for a, b, c in log.points]
    blocks = ["".join(lines[k * log.columns : (k + 1) * log.columns]) for k in range(log.rows)]
    path.write_text(head + "\n".join(blocks))
    return MM


@form("Grbl log", step=1e-6)
def _(log: Raster, path: Path) -> dict[str, Any]:
    lines = [
        f"ok\n<Idle|MPos:{x:.3f},{y:.3f},0.000|FS:0,0>\n[PRB:{x:.6f},{y:.6f},{z:.6f}:1]\n" for x, y, z in log.points
    ]
    path.write_text("Grbl 1.1h ['$' for help]\n$13=0\n" + "".join(lines) + "[PRB:0.000,0.000,-5.000:0]\n")
    return {}


@form("LinuxCNC probe log", step=1e-6)
def _(log: Raster, path: Path) -> dict[str, Any]:
    path.write_text("".join(f"{x:.6f} {y:.6f} {z:.6f}" + " 0.000000" * 6 + "\n" for x, y, z in log.points))
    return MM


@form("TUM trajectory")
def _(log: Raster, path: Path) -> dict[str, Any]:
    lines = [
        f"{t:.6f} {x:.12f} {y:.12f} {z:.12f} 0 0 0 1\n" for t, (x, y, z) in zip(log.t, 1e-3 * log.points, strict=True)
    ]
    path.write_text("# timestamp tx ty tz qx qy qz qw\n" + "".join(lines))
    return {}


@form("PlotJuggler CSV")
def _(log: Raster, path: Path) -> dict[str, Any]:
    with path.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        names = ["x", "y", "z"]
        writer.writerow(["__time", *(f"/tip/pose/position/{axis}" for axis in names), "/battery/voltage"])
        for t, (x, y, z) in zip(log.t, 1e-3 * log.points, strict=True):
            writer.writerow([f"{1.7e9 + t:.6f}", f"{x:.12f}", f"{y:.12f}", f"{z:.12f}", "12.5"])
    return {"units": "m"}


@form("stylus text")
def _(log: Raster, path: Path) -> dict[str, Any]:
    head = f"SampleName,plate\nStylus Type,Radius: {RADIUS * 1e3:g} um\nNumPts,{len(log.points)},\nSpeed,10,um/s\n\n"
    path.write_text(head + "X (um),Y (um),Z (um)\n" + as_text(log, header="", scale=1e3))
    return {}


# --- robots ---------------------------------------------------------------------------------------------


def _messages(store: Any, kind: str, log: Raster, stamp: Callable[[float], Any]) -> Any:
    """Messages of one kind: (topic, type, message, ns)."""
    types = store.types
    header = lambda t, number=0: types["std_msgs/msg/Header"](  # noqa: E731
        **({"seq": number} if "seq" in types["std_msgs/msg/Header"].__dataclass_fields__ else {}),
        stamp=stamp(t),
        frame_id="base",
    )
    point, turn = types["geometry_msgs/msg/Point"], types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    vector = types["geometry_msgs/msg/Vector3"]
    metres = (1e-3 * log.points).tolist()
    if kind == "PointCloud2":
        field = types["sensor_msgs/msg/PointField"]
        fields = [field(name=axis, offset=8 * k, datatype=8, count=1) for k, axis in enumerate("xyz")]
        for row in range(log.rows):
            part = slice(row * log.columns, (row + 1) * log.columns)
            data = np.frombuffer((1e-3 * log.points[part]).tobytes(), np.uint8)
            t = float(log.t[part][0])
            yield (
                "/cloud",
                "sensor_msgs/msg/PointCloud2",
                types["sensor_msgs/msg/PointCloud2"](
                    header(t), 1, log.columns, fields, False, 24, 24 * log.columns, data, True
                ),
                int(1e9 * (1.0 + t)),
            )
        return
    for number, (t, place) in enumerate(zip(log.t.tolist(), metres, strict=True)):
        ns = round(1e9 * (1.0 + t))
        if kind == "PointStamped":
            message = types["geometry_msgs/msg/PointStamped"](header(t, number), point(*place))
        elif kind == "PoseStamped":
            pose = types["geometry_msgs/msg/Pose"](point(*place), turn)
            message = types["geometry_msgs/msg/PoseStamped"](header(t, number), pose)
        elif kind == "Odometry":
            pose = types["geometry_msgs/msg/Pose"](point(*place), turn)
            zero = np.zeros(36)
            still = types["geometry_msgs/msg/Twist"](vector(0.0, 0.0, 0.0), vector(0.0, 0.0, 0.0))
            message = types["nav_msgs/msg/Odometry"](
                header(t, number), "tip", types["geometry_msgs/msg/PoseWithCovariance"](pose, zero),
                types["geometry_msgs/msg/TwistWithCovariance"](still, zero),
            )  # fmt: skip
        else:
            move = types["geometry_msgs/msg/TransformStamped"](
                header(t, number), "tip", types["geometry_msgs/msg/Transform"](vector(*place), turn)
            )
            yield "/tf", "tf2_msgs/msg/TFMessage", types["tf2_msgs/msg/TFMessage"]([move]), ns
            continue
        package = "nav_msgs" if kind == "Odometry" else "geometry_msgs"
        yield "/tip", f"{package}/msg/{kind}", message, ns
        if kind == "PoseStamped":
            wrench = types["geometry_msgs/msg/Wrench"](vector(0.0, 0.0, 1.5), vector(0.0, 0.0, 0.0))
            felt = types["geometry_msgs/msg/WrenchStamped"](header(t, number), wrench)
            yield "/ft", "geometry_msgs/msg/WrenchStamped", felt, ns


def _ns(types: Any, ros: int) -> Callable[[float], Any]:
    time = types["builtin_interfaces/msg/Time"]
    return lambda t: time(int(1.0 + t), round(1e9 * ((1.0 + t) % 1.0)) % 10**9)


def _bag(log: Raster, path: Path, ros: int, kind: str, compression: str = "") -> dict[str, Any]:
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin, Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
    place = path.with_name(path.name + ".made")
    if ros == 1:
        writer: Any = Writer1(place)
        if compression:
            writer.set_compression(Writer1.CompressionFormat[compression])
    else:
        writer = Writer2(place, version=9, storage_plugin=StoragePlugin[compression or "SQLITE3"])
    with writer as bag:
        known: dict[str, Any] = {}
        for topic, name, message, ns in _messages(store, kind, log, _ns(store.types, ros)):
            if topic not in known:
                known[topic] = bag.add_connection(topic, name, typestore=store)
            data = store.serialize_ros1(message, name) if ros == 1 else store.serialize_cdr(message, name)
            bag.write(known[topic], ns, data)
    made = place if ros == 1 else next(each for each in place.iterdir() if each.suffix in (".db3", ".mcap"))
    made.rename(path)
    return {}


for _kind in ("PoseStamped", "PointStamped", "Odometry", "PointCloud2", "TFMessage"):
    if _kind != "TFMessage":  # which the library cannot write for ROS 1
        form(f"ROS 1 bag, {_kind}", "rosbags")(lambda log, path, kind=_kind: _bag(log, path, 1, kind))
    form(f"ROS 2 bag, {_kind}", "rosbags")(lambda log, path, kind=_kind: _bag(log, path, 2, kind))
form("ROS 1 bag, bz2", "rosbags")(lambda log, path: _bag(log, path, 1, "PointStamped", "BZ2"))
form("ROS 1 bag, lz4", "rosbags")(lambda log, path: _bag(log, path, 1, "PointStamped", "LZ4"))
form("ROS 2 MCAP", "rosbags")(lambda log, path: _bag(log, path, 2, "PoseStamped", "MCAP"))


def _mcap(log: Raster, path: Path, compression: str) -> dict[str, Any]:
    from mcap.writer import CompressionType, Writer

    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType[compression])
        writer.start()
        schema = writer.register_schema("foxglove.PoseInFrame", "jsonschema", b'{"type": "object"}')
        channel = writer.register_channel("/tip", "json", schema)
        for t, place in zip(log.t.tolist(), (1e-3 * log.points).tolist(), strict=True):
            ns = round(1e9 * (1.0 + t))
            message = {
                "timestamp": {"sec": ns // 10**9, "nsec": ns % 10**9},
                "frame_id": "base",
                "pose": {"position": dict(zip("xyz", place, strict=True)), "orientation": {"w": 1.0}},
            }
            writer.add_message(channel, ns, json.dumps(message).encode(), ns)
        writer.finish()
    return {}


for _kind in ("NONE", "LZ4", "ZSTD"):
    form(f"MCAP of JSON, {_kind}")(lambda log, path, kind=_kind: _mcap(log, path, kind))
