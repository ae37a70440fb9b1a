"""Mesh files: any common format becomes a Surface in metres, or an error that names the file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from explore3d import MeshFileError, count_text, unit_factor
from mapping import Surface, SurfaceError, length_text

# Sides of the smallest and the largest body that a fingertip explores, m: the apex of a probe microscope's tip, and
# what no unit but a wrong one gives
SMALLEST_BODY, LARGEST_BODY = 1e-8, 1e3
# Share of the edges between two faces that may be walked the same way by both: of a mesh whose faces are turned at
# random it is a half, of one that has a side it is none but for a few seams
MOST_TURNED_EDGES = 0.1
FORMATS = ("glb", "gltf", "obj", "off", "ply", "stl")


def load_mesh(path: Path | str, units: str = "m") -> Surface:
    """The triangle mesh in a file.

    Vertices and faces are kept in the file's order, nothing is merged, dropped or repaired; larger
    polygons are split into triangles. Only STL, which has no shared vertices, has its bit-identical
    corners joined.

    Args:
        path: a file in one of FORMATS.
        units: unit of length of the file's coordinates, for example "mm".

    Raises:
        MeshFileError: no such file, not a mesh, no faces, coordinates that are not finite, no area, no size that a
            body can have, faces that are turned inside and out, or a solid whose faces all look inwards.
        UnitError: an unknown unit.
    """
    factor = unit_factor(units)
    path = Path(path)
    vertices, faces = _read(path)
    if len(vertices) == 0 or len(faces) == 0:
        raise MeshFileError(
            f"{path}: the mesh is empty ({len(vertices)} vertices, {len(faces)} faces); at least one triangle is needed"
        )
    try:
        surface = Surface(vertices * factor, faces)
    except SurfaceError as error:
        raise MeshFileError(f"{path}: {error}") from error
    return checked_mesh(path, surface)


def checked_mesh(path: Path | str, surface: Surface) -> Surface:
    """The surface that a file holds, or that memory holds by its name.

    Raises:
        MeshFileError: it can be no body's, as for `load_mesh`.
    """
    if complaint := _no_body(surface.vertices, surface.faces):
        raise MeshFileError(f"{path}: {complaint}")
    return surface


def extent_text(surface: Surface) -> str:
    """The sides of the box about a surface, "100 mm x 60 mm x 5 mm"."""
    return " x ".join(length_text(float(size)) for size in np.ptp(surface.vertices, axis=0))


def mesh_text(surface: Surface) -> str:
    """What a mesh is, in words by which a wrong unit, a hole and doubled faces are noticed; one line."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    ways = np.sort(np.concatenate([surface.faces[:, pair] for pair in ([0, 1], [1, 2], [2, 0])]), axis=1)
    edges, faces = np.unique(ways, axis=0, return_counts=True)
    border, shared = edges[faces == 1], int((faces > 2).sum())
    state = "closed"
    if len(border):
        corners, ends = np.unique(border, return_inverse=True)
        first, second = ends.reshape(-1, 2).T
        graph = coo_array((np.ones(len(first)), (first, second)), shape=(len(corners), len(corners)))
        state = f"open, with {count_text(int(connected_components(graph)[0]), 'border')}"
    crowded = f"; {count_text(shared, 'edge')} with more than two faces" if shared else ""
    return f"{extent_text(surface)}, {count_text(len(surface.faces), 'face')}, {state}{crowded}"


def _no_body(vertices: np.ndarray, faces: np.ndarray) -> str:
    """Why vertices (m) and faces can be no body's surface, "" if nothing speaks against it."""
    size = float(np.ptp(vertices, axis=0).max())
    if not SMALLEST_BODY <= size <= LARGEST_BODY:
        possible = f"possible: {SMALLEST_BODY:g} to {LARGEST_BODY:g} m"
        return f"the mesh is {size:.3g} m long; {possible}; is its unit the right one?"
    a, b, c = (vertices[faces[:, corner]] / size for corner in range(3))
    if not np.cross(b - a, c - a).any():
        return f"none of its {len(faces)} faces has an area"
    ways = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
    edges = np.sort(ways, axis=1) @ np.array([len(vertices), 1])
    forth = ways[:, 0] < ways[:, 1]
    order = np.argsort(edges, kind="stable")
    edges, forth = edges[order], forth[order]
    first = np.flatnonzero(np.diff(edges, prepend=-1))
    pairs = first[np.diff(np.append(first, len(edges))) == 2]
    turned = int((forth[pairs] == forth[pairs + 1]).sum())
    if turned > MOST_TURNED_EDGES * len(pairs):
        return (
            f"{turned} of the {len(pairs)} edges between its faces join an outer side to an inner one: the faces are "
            "turned both ways; orient them alike in a mesh program"
        )
    is_closed = turned == 0 and len(pairs) == len(first)
    if is_closed and _is_inside_out(a, b, c):
        return (
            "the mesh is closed and its faces look inwards: a solid turned inside out, which a finger would touch from "
            "within; flip the faces in a mesh program"
        )
    return ""


def _is_inside_out(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> bool:
    """True if triangles with corners (F, 3) that close a surface bound a volume below zero, rounding allowed for.

    Cavities count against the solid that they lie in, so that a body with bores and hollows is none.
    """
    middle = a.mean(axis=0)
    parts = np.einsum("fi,fi->f", a - middle, np.cross(b - middle, c - middle))
    rounding = np.finfo(float).eps * len(parts) * float(np.abs(parts).sum())
    return bool(float(parts.sum()) < -rounding)


def _read(path: Path) -> tuple[np.ndarray, np.ndarray]:
    import trimesh

    kind = path.suffix.lower().lstrip(".")
    if not path.is_file():
        raise MeshFileError(f"{path}: {'a folder, not a mesh file' if path.is_dir() else 'no such mesh file'}")
    if kind not in FORMATS:
        raise MeshFileError(f"{path}: not a mesh format that is understood; possible: {', '.join(FORMATS)}")
    try:
        mesh = trimesh.load_mesh(path, process=False, maintain_order=True)
    except Exception as error:  # the readers of each format raise whatever they stumble over
        raise MeshFileError(f"{path}: not a readable {kind.upper()} mesh ({_first_line(error)})") from error
    vertices = np.asarray(getattr(mesh, "vertices", np.zeros((0, 3))), dtype=np.float64)
    faces = np.asarray(getattr(mesh, "faces", np.zeros((0, 3), dtype=np.int64)))
    return _join_identical(vertices, faces) if kind == "stl" and len(faces) else (vertices, faces)


def _join_identical(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    unique, index = np.unique(vertices, axis=0, return_inverse=True)
    return unique, index.reshape(-1)[faces]


def _first_line(error: Exception) -> str:
    text = str(error).strip().splitlines()
    return text[0] if text else type(error).__name__
