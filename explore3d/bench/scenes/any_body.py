"""Any body: shipped ones with concave parts and others from files, with details laid on at places of chance."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np

from explore3d import UserError
from explore3d.bench.scenes.bodies import Mesh
from explore3d.bench.scenes.exploring import BASE_MESH, OBJECT_MESH, BenchScene
from explore3d.bench.scenes.laid_on import drawn_details, laid_on
from explore3d.scene import example, load_mesh, load_scene, scene_text
from mapping import Surface

# Seeds of the details' places and of the noise: those that the planner was built with, and those that are reported
BODY_BUILDING_SEEDS, BODY_REPORTED_SEEDS = (1, 2, 3), (102, 103, 104)
SHIPPED_BODIES = ("l_bracket", "vase", "bowl", "holed_plate", "double_ring", "folds", "heat_sink")
# Bodies that other people published, which do not come with the program; each is made so long, m
FILED_BODIES = {"bunny": "bunny.off", "spot": "spot.obj", "fandisk": "fandisk.off"}
FILED_LENGTH = 0.07
ANY_BODIES = (*SHIPPED_BODIES, *FILED_BODIES)
# The scene whose settings hold for bodies from files, too
SETTINGS_OF = "l_bracket"


def any_body(name: str, seed: int, folder: Path | None = None) -> tuple[BenchScene, str]:
    """A body with details laid on, and the text of its scene: that of the shipped one but for seed, object and truth.

    Args:
        name: of ANY_BODIES.
        folder: where the files of FILED_BODIES lie; None: they are not there.

    Raises:
        UserError: the body's file is not there.
    """
    shipped = example(name if name in SHIPPED_BODIES else SETTINGS_OF).scene
    tables: dict[str, Any] = tomllib.loads(shipped.read_text(encoding="utf-8"))
    if name in SHIPPED_BODIES:
        base = load_scene(shipped).base_surface()
        assert base is not None  # each of them gives a mesh
        mesh: Mesh = base.vertices, base.faces
    else:
        mesh = filed_body(name, folder)
        base = Surface(*mesh)
    tip_radius = load_scene(shipped).tip.radius
    details = drawn_details(base, tip_radius, np.random.default_rng(seed))
    tables |= {"title": f"{name} with details of seed {seed}", "seed": seed}
    tables["model"] |= {"mesh": BASE_MESH}
    tables["finger"] |= {"object": OBJECT_MESH}
    truths = tuple(detail.truth for detail in details)
    tables["truth"] = [
        {"kind": true.kind, "axis": true.axis.tolist(), "height": true.height, "width": true.width} for true in truths
    ]
    return BenchScene(base, Surface(*laid_on(mesh, details)), truths, None), scene_text(tables)


def filed_body(name: str, folder: Path | None) -> Mesh:
    """A published body FILED_LENGTH long, its corners that lie in one place joined. Raises UserError."""
    path = None if folder is None else folder / FILED_BODIES[name]
    if path is None or not path.exists():
        raise UserError(f"{name}: its file {FILED_BODIES[name]} does not come with the program; give its folder")
    surface = load_mesh(path)
    vertices, index = np.unique(surface.vertices, axis=0, return_inverse=True)
    faces = index.reshape(-1)[surface.faces]
    distinct = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return FILED_LENGTH / float(np.ptp(vertices, axis=0).max()) * vertices, faces[distinct]
