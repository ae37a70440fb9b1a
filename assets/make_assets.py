"""Make the meshes of assets/meshes and the truth tables of assets/scenes: python assets/make_assets.py.

Everything follows from the numbers below, so a second run writes the same bytes. Lengths in metres.
"""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Mesh = tuple[FloatArray, IntArray]

FOLDER = Path(__file__).resolve().parent
MARK = "# Truth of the simulated object, written by make_assets.py"


def main() -> None:
    """Write every mesh and every truth table."""
    make_plate()
    make_wire()


TILT = np.radians(45.0)
PLATE = (0.200, 0.150)
WIRE = {"diameter": 0.65e-3, "length": 0.080, "center": (0.012, -0.007), "direction": np.radians(25.0)}


def make_plate() -> None:
    """The upper face of a plate tilted by 45 degrees about x, alone."""
    u, v = (np.linspace(-size / 2, size / 2, 41) for size in PLATE)
    vertices, faces = height_field(u, v, np.zeros((len(u), len(v))))
    write_mesh("plate", (tilted(vertices), faces))
    write_truth("empty_plate", [])


def make_wire() -> None:
    """The plate with a straight wire, cut square at both ends, lying on it."""
    u, v = (np.linspace(-size / 2, size / 2, 41) for size in PLATE)
    radius = WIRE["diameter"] / 2
    along = np.array([np.cos(WIRE["direction"]), np.sin(WIRE["direction"]), 0.0])
    ends = np.array([*WIRE["center"], 0.0]) + WIRE["length"] / 2 * np.array([[-1.0], [1.0]]) * along
    path = ends[0] + np.linspace(0, 1, 21)[:, None] * (ends[1] - ends[0])
    wire = tube(path + np.array([0.0, 0.0, radius]), np.tile([0.0, 0.0, 1.0], (len(path), 1)), radius, sides=64)
    plate = height_field(u, v, np.zeros((len(u), len(v))))
    vertices, faces = together(plate, wire)
    write_mesh("wire_on_plate", (tilted(vertices), faces))
    truth = {"kind": "ridge", "axis": tilted(ends), "height": 2 * radius, "width": 2 * radius, "length": WIRE["length"]}
    write_truth("wire_on_plate", [truth])


def tilted(points: FloatArray) -> FloatArray:
    """Points of the plate's frame (u, v, outward) in the object frame."""
    c, s = np.cos(TILT), np.sin(TILT)
    rotation: FloatArray = np.array([[1, 0, 0], [0, c, s], [0, -s, c]])
    return np.asarray(points @ rotation)


def height_field(u: FloatArray, v: FloatArray, height: FloatArray) -> Mesh:
    """Triangles over the grid u x v with heights (len(u), len(v)), outward up."""
    grid = np.stack([*np.meshgrid(u, v, indexing="ij"), height], axis=-1)
    return grid.reshape(-1, 3), grid_faces(len(u), len(v))


def grid_faces(rows: int, columns: int, closed: bool = False) -> IntArray:
    """Two triangles for each cell of a grid of vertices, row-major; `closed` joins the last column to the first."""
    index = np.arange(rows * columns).reshape(rows, columns)
    if closed:
        index = np.column_stack([index, index[:, 0]])
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    return np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)


def tube(path: FloatArray, up: FloatArray, radius: float, sides: int) -> Mesh:
    """A round tube about a path (K, 3), cut square at both ends; one vertex of each ring points to `up` (K, 3).

    Facets lie radius * (1 - cos(pi / sides)) inside the round: 0.4 um for 0.325 mm and 64 sides.
    """
    tangent = np.gradient(path, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    side = np.cross(tangent, up)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    angle = 2 * np.pi * np.arange(sides) / sides
    circle = np.cos(angle)[:, None] * np.cross(side, tangent)[:, None, :] + np.sin(angle)[:, None] * side[:, None, :]
    rings = (path[:, None, :] + radius * circle).reshape(-1, 3)
    wall = grid_faces(len(path), sides, closed=True)[:, ::-1]
    first, last = np.arange(sides), np.arange(sides) + (len(path) - 1) * sides
    start = np.column_stack([np.full(sides, len(rings)), np.roll(first, -1), first])
    stop = np.column_stack([np.full(sides, len(rings) + 1), last, np.roll(last, -1)])
    return np.vstack([rings, path[[0, -1]]]), np.vstack([wall, start, stop])


def together(*meshes: Mesh) -> Mesh:
    """The union as one list of triangles: a ball that touches from outside cannot tell it from a boolean union."""
    starts = itertools.accumulate((len(vertices) for vertices, _ in meshes[:-1]), initial=0)
    return (
        np.vstack([vertices for vertices, _ in meshes]),
        np.vstack([faces + start for (_, faces), start in zip(meshes, starts, strict=True)]),
    )


def write_mesh(name: str, mesh: Mesh) -> None:
    """Binary PLY with double coordinates: single precision would move the wire's facets by up to 8 nm."""
    vertices, faces = mesh
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\nproperty double x\nproperty double y\n"
        f"property double z\nelement face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = np.empty(len(faces), dtype=[("count", "u1"), ("index", "<i4", 3)])
    rows["count"], rows["index"] = 3, faces
    path = FOLDER / "meshes" / f"{name}.ply"
    path.write_bytes(header.encode() + np.ascontiguousarray(vertices, dtype="<f8").tobytes() + rows.tobytes())


def write_truth(scene: str, truths: list[dict[str, object]]) -> None:
    """Replace what stands below MARK in the scene by these features."""
    path = FOLDER / "scenes" / f"{scene}.toml"
    head = path.read_text(encoding="utf-8").split(MARK)[0].rstrip("\n")
    tables = [f"\n[[truth]]\n{''.join(f'{key} = {toml(value)}' + chr(10) for key, value in t.items())}" for t in truths]
    tail = f"\n\n{MARK}\n{''.join(tables)}" if truths else "\n"
    path.write_text(head + tail, encoding="utf-8")


def toml(value: object) -> str:
    """A string, a length in metres to the nanometre, or a polyline of such lengths."""
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, np.ndarray):
        points = [f"[{', '.join(toml(float(x)) for x in point)}]" for point in np.atleast_2d(value)]
        return f"[{', '.join(points)}]" if len(points) < 4 else "[\n    " + ",\n    ".join(points) + ",\n]"
    return repr(round(float(value), 9) + 0.0)  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
