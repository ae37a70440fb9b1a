"""Stability on meshes that are no clean surfaces: an answer, or an error in words; never a crash, never nonsense."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from explore3d.bench import bump_mesh
from explore3d.stability.table import Answer, Case
from mapping import MappingError, Surface
from mapping.geometry.contact import BallContact
from mapping.geometry.curvature import principal_curvatures
from mapping.geometry.mesh import NearestPoint

TRIANGLE = ([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[0, 1, 2]])


def _with(vertices: object, faces: object) -> Callable[[], Surface]:
    """The bump's mesh with further vertices and faces (counted from its last vertex on)."""

    def make() -> Surface:
        mesh = bump_mesh(800)
        more = np.asarray(vertices, dtype=np.float64).reshape(-1, 3)
        extra = np.asarray(faces, dtype=np.int64).reshape(-1, 3) + len(mesh.vertices)
        return Surface(np.vstack([mesh.vertices, more]), np.vstack([mesh.faces, extra]))

    return make


def _three_on_an_edge() -> Surface:
    return Surface([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]], [[0, 1, 2], [1, 0, 3], [0, 1, 4]])


def _inconsistent() -> Surface:
    mesh, rng = bump_mesh(800), np.random.default_rng(5)
    faces = mesh.faces.copy()
    turned = rng.random(len(faces)) < 0.5
    faces[turned] = faces[turned][:, ::-1]
    return Surface(mesh.vertices, faces)


def _holes() -> Surface:
    mesh, rng = bump_mesh(800), np.random.default_rng(6)
    return Surface(mesh.vertices, mesh.faces[rng.random(len(mesh.faces)) < 0.5])


MESHES: dict[str, Callable[[], Surface]] = {
    "no vertex": lambda: Surface(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)),
    "no face": lambda: Surface(np.zeros((3, 3)), np.zeros((0, 3), dtype=np.int64)),
    "index out of range": lambda: Surface(TRIANGLE[0], [[0, 1, 3]]),
    "NaN": lambda: Surface(np.array([[0, 0, np.nan], [1, 0, 0], [0, 1, 0]]), TRIANGLE[1]),
    "infinite": lambda: Surface(np.array([[0, 0, np.inf], [1, 0, 0], [0, 1, 0]]), TRIANGLE[1]),
    "one triangle": lambda: Surface(*TRIANGLE),
    "a point as a triangle": lambda: Surface(np.zeros((3, 3)), TRIANGLE[1]),
    "a line as a triangle": lambda: Surface([[0, 0, 0], [1, 0, 0], [2, 0, 0]], TRIANGLE[1]),
    "unreferenced vertex at the end": lambda: Surface([*bump_mesh(800).vertices, [9, 9, 9]], bump_mesh(800).faces),
    "degenerate faces": _with([[0, 0, 1], [0, 0, 1], [0, 0, 1], [0.1, 0, 1]], [[0, 1, 2], [0, 0, 3], [3, 3, 3]]),
    "three faces on an edge": _three_on_an_edge,
    "faces turned at random": _inconsistent,
    "half of the faces missing": _holes,
    "a far speck": _with([[1e6, 0, 0], [1e6, 1e-3, 0], [1e6, 0, 1e-3]], [[0, 1, 2]]),
    "a sliver of 1e-12": _with([[0.2, 0, 2], [0.9, 0, 2], [0.5, 1e-12, 2]], [[0, 1, 2]]),
}


def _contact(mesh: Surface) -> str:
    found = BallContact(mesh, 0.3).first_contact([[0.21, 0.17, 5.0], [50.0, 0.0, 5.0]], [0, 0, -1.0])
    clean = (np.isfinite(found.centers).all(axis=1) == (found.count > 0)).all()
    return f"{int((found.count > 0).sum())} of 2 rest" if clean else "NONSENSE"


def _nearest(mesh: Surface) -> str:
    found = NearestPoint(mesh).query([[0.21, 0.17, 5.0]])
    unit = np.linalg.norm(found.normals, axis=1)
    return (
        f"distance {found.distance[0]:.3g}"
        if np.isfinite(found.distance).all() and (unit < 1.001).all()
        else "NONSENSE"
    )


def _curvature(method: str) -> Callable[[Surface], str]:
    def run(mesh: Surface) -> str:
        found = principal_curvatures(mesh, method=method)
        clean = np.isfinite(found.k1[found.valid]).all() and np.isnan(found.k1[~found.valid]).all()
        return f"{int(found.valid.sum())} of {len(found.valid)} values" if clean else "NONSENSE"

    return run


WAYS: dict[str, Callable[[Surface], str]] = {
    "contact": _contact,
    "nearest": _nearest,
    "jets": _curvature("jet"),
    "libigl": _curvature("libigl"),
}


def tried(name: str) -> Callable[[], Answer]:
    """Contact, nearest point and both curvatures on one mesh."""

    def run() -> Answer:
        try:
            mesh = MESHES[name]()
        except MappingError as error:
            return Answer(f"refused: {error}", reason="an error that says what was found")
        said = []
        for way, ask in WAYS.items():
            try:
                said.append(f"{way}: {ask(mesh)}")
            except MappingError as error:
                said.append(f"{way}: refused ({error})")
        found = "; ".join(said)
        reason = "an answer, NaN with valid = False, or an error in words"
        return Answer(found, reason=reason, holds="NONSENSE" not in found)

    return run


MESH_CASES = [Case("meshes", name, "no crash, no nonsense", tried(name)) for name in MESHES]
