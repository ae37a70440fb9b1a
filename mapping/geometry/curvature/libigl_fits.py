"""Curvature by libigl's quadratic fits, with every input that it cannot survive kept away from it.

libigl 2.6.3 ends the process on some meshes (vertices with fewer than six neighbours, small components, vertices
of no face) and returns zeros or nonsense for others (degenerate faces, inconsistent winding): theory section 9.
The mesh is cleaned first, and the call runs in a process of its own, so that whatever remains cannot do harm.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mapping import CurvatureError, FloatArray, IntArray, Surface
from mapping.geometry.curvature.curvature import Curvature

# A component needs this many vertices for six neighbours everywhere and a fit that is more than interpolation.
SMALLEST_COMPONENT = 20
# Area over squared longest edge below which a face has no normal that libigl can use.
FLATTEST_FACE = 1e-10
LIBIGL_TIMEOUT = 600
_CALL = """
import sys
import igl
import numpy as np
data = np.load(sys.argv[1])
for radius in data["radii"]:
    d1, d2, k1, k2, bad = igl.principal_curvature(data["v"], data["f"], int(radius), bool(data["rings"]))
    np.savez(f"{sys.argv[2]}/{radius}.npz", d1=d1, d2=d2, k1=k1, k2=k2, bad=np.asarray(bad, dtype=np.int64))
"""


def libigl_curvature(surface: Surface, radius: int = 5, rings: bool = True) -> Curvature:
    """`igl.principal_curvature` where it can be trusted, and NaN elsewhere.

    Args:
        surface: any mesh.
        radius: rings of neighbours, or average edge lengths if `rings` is False; at least 2.
        rings: count rings rather than distance.

    Raises:
        CurvatureError: a radius under 2 (libigl would silently take 2).
    """
    return libigl_curvatures(surface, (radius,), rings)[0]


def libigl_curvatures(surface: Surface, radii: Sequence[int], rings: bool = True) -> tuple[Curvature, ...]:
    """The same for several radii, all in one process; what is lost with it at one radius is NaN, and a remark says so.

    Args:
        surface: any mesh.
        radii: rings of neighbours, or average edge lengths if `rings` is False; each at least 2.
        rings: count rings rather than distance.

    Raises:
        CurvatureError: a radius under 2.
    """
    for radius in radii:
        if radius < 2:
            raise CurvatureError(f"libigl fits over at least 2 rings of neighbours; found radius {radius}")
    faces = _sound_faces(surface)
    used, faces = np.unique(faces, return_inverse=True)
    faces = faces.reshape(-1, 3).astype(np.int64)
    if not len(faces):
        none = _spread(surface, used, None, "no part of the mesh is sound enough for libigl")
        return tuple(none for _ in radii)
    results, why = _in_own_process(surface.vertices[used], faces, radii, rings)
    return tuple(_spread(surface, used, results.get(radius), why) for radius in radii)


def _spread(surface: Surface, used: IntArray, result: dict[str, FloatArray] | None, why: str) -> Curvature:
    """Curvature at all vertices from what libigl said of the used ones, None if nothing."""
    count = len(surface.vertices)
    k1, k2 = np.full(count, np.nan), np.full(count, np.nan)
    d1, d2 = np.full((count, 3), np.nan), np.full((count, 3), np.nan)
    if result is not None:
        trusted = np.isfinite(result["k1"]) & np.isfinite(result["k2"])
        trusted[result["bad"]] = False
        trusted &= (np.abs(result["d1"]).sum(axis=1) > 0) & (np.abs(result["d2"]).sum(axis=1) > 0)
        keep = used[trusted]
        k1[keep], k2[keep] = result["k1"][trusted], result["k2"][trusted]
        d1[keep], d2[keep] = result["d1"][trusted], result["d2"][trusted]
    return Curvature(
        k1, k2, d1, d2, np.full(count, np.nan), np.isfinite(k1), remarks=(why,) if result is None and why else ()
    )


def _sound_faces(surface: Surface) -> IntArray:
    """Faces of large enough, consistently wound components, without degenerate and repeated ones."""
    faces = surface.faces
    corners = surface.vertices[faces]
    edges = np.roll(corners, -1, axis=1) - corners
    longest = (edges**2).sum(axis=2).max(axis=1)
    scale = np.maximum(longest, np.finfo(float).tiny)
    sound = (surface.face_areas / scale > FLATTEST_FACE) & (longest > 0)
    faces = faces[sound]
    if len(faces) == 0:
        return np.asarray(faces)
    faces = faces[np.sort(np.unique(np.sort(faces, axis=1), axis=0, return_index=True)[1])]
    component, sizes = _components(faces, len(surface.vertices))
    wanted = sizes >= SMALLEST_COMPONENT
    wanted[component[_turned(faces)]] = False
    return np.asarray(faces[wanted[component[faces[:, 0]]]])


def _components(faces: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """Component of every vertex, and the number of vertices in each component."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    total, component = connected_components(graph, directed=False)
    return component.astype(np.int64), np.bincount(component, minlength=total)


def _turned(faces: IntArray) -> IntArray:
    """Vertices of edges that two faces run through in the same direction (inconsistent winding)."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    unique, times = np.unique(edges, axis=0, return_counts=True)
    return np.asarray(np.unique(unique[times > 1]))


def _in_own_process(
    vertices: FloatArray, faces: IntArray, radii: Sequence[int], rings: bool
) -> tuple[dict[int, dict[str, FloatArray]], str]:
    """What libigl says of each radius until it ends, and a sentence if it did not survive all of them."""
    found, why = {}, ""
    with tempfile.TemporaryDirectory() as folder:
        question = Path(folder) / "question.npz"
        np.savez(question, v=vertices, f=faces, radii=np.asarray(radii, dtype=np.int64), rings=rings)
        try:
            ended = subprocess.run(
                [sys.executable, "-c", _CALL, str(question), folder],
                check=False,
                timeout=LIBIGL_TIMEOUT,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
                errors="replace",
            )
            if ended.returncode:
                said = ended.stderr.strip().splitlines()[-1:] or [f"it ended with status {ended.returncode}"]
                why = f"libigl could not be asked: {said[0]}"
        except subprocess.TimeoutExpired:
            why = f"libigl took longer than {LIBIGL_TIMEOUT} s"
        for radius in radii:
            answer = Path(folder) / f"{radius}.npz"
            if answer.exists():
                try:
                    with np.load(answer) as values:
                        found[radius] = {name: values[name] for name in values.files}
                except (ValueError, OSError, zipfile.BadZipFile):  # it ended while writing
                    why = why or "libigl ended while it answered"
    return found, why
