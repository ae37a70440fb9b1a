"""Mesh files: any common format becomes a Surface in metres, or an error that names the file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from explore3d import MeshFileError, unit_factor
from mapping import Surface, SurfaceError

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
        MeshFileError: no such file, not a mesh, no faces, or coordinates that are not finite.
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
        return Surface(vertices * factor, faces)
    except SurfaceError as error:
        raise MeshFileError(f"{path}: {error}") from error


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
