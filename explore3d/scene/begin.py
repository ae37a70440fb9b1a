"""A scene to begin from, for somebody's own mesh, tip and finger."""

from __future__ import annotations

import shutil
from pathlib import Path

from explore3d import MeshFileError, parse_length
from explore3d.scene.examples import SCENE_FILE, refuse_to_replace
from explore3d.scene.machine import EMULATOR
from explore3d.scene.scene import parse_scene
from mapping import Surface

FINGER_KINDS = ("simulated", "grbl")

_SIMULATED = """\
# The embedded simulation touches this mesh: give one with fine details on it to rehearse the search for them.
[finger]
kind = "simulated"
object = {mesh}
units = {units}
rate = "1 kHz"

[finger.noise]
white = {white}
"""

_GRBL = """\
# A stage of the Grbl family with a touch probe. Nothing moves without --arm; read docs/hardware.md before.
[finger]
kind = "grbl"
{touched}
[finger.machine]
port = {port}
origin = ["-150 mm", "-150 mm", "-60 mm"]   # where the object stands in machine coordinates
touch = "peck"
step = "0.5 mm"
{pace}"""

_SCENE = """\
# Every key is explained in docs/scene.md; `explore3d plan {file}` shows the sweeps before anything moves.
schema = "explore3d/scene/1"
title = {title}
seed = 1

[tip]
radius = {radius}

# The global model: what is known of the object beforehand.
[model]
mesh = {model_mesh}
units = {model_units}

{finger}
[survey]
smallest_feature = {smallest}   # the lowest crest that must not be missed
speed = "20 mm/s"
force = "1 N"

[explore]
time_budget = {budget}
"""
# The lowest crest that a scene asks for, in tip radii: pecks are slow, and lie closer together the lower it is
SMALLEST = {"simulated": 1.0 / 30.0, "grbl": 1.0 / 10.0}
BUDGETS = {"simulated": "10 min", "grbl": "2 h"}
# A tip that comes from above touches faces that rise less steeply than this: cosine to the vertical
FROM_ABOVE = 0.3


def begin_scene(
    folder: Path, mesh: Path, units: str, tip_radius: str, finger: str = "simulated", port: str = EMULATOR
) -> Path:
    """Write a scene for a mesh, and a copy of that mesh beside it; the scene's path.

    What is not asked follows from the tip: details from a thirtieth of its radius (a tenth for a Grbl machine), noise
    of a tenth of that. A Grbl machine comes from above: its global model is that part of the mesh, in its own file.

    Args:
        folder: where it belongs; made if it is not there.
        mesh: the global model.
        units: unit of length of that file.
        tip_radius: of the spherical tip, such as "5 mm".
        finger: "simulated" or "grbl".
        port: of a Grbl machine.

    Raises:
        UnitError, SceneError, MeshFileError: a value, or the mesh, is none, or no face of it can be touched from above.
        FolderError: a scene, or another mesh of that name, is there already; nothing is written then.
    """
    if not mesh.is_file():
        raise MeshFileError(f"{mesh}: {'a folder, not a mesh file' if mesh.is_dir() else 'no such mesh file'}")
    path = folder / SCENE_FILE
    smallest = SMALLEST[finger] * parse_length(tip_radius)
    values = {"mesh": _quoted(mesh.name), "units": _quoted(units), "white": _quoted(f"{1e6 * smallest / 10.0:.3g} um")}
    values |= {"port": _quoted(port), "touched": "", "pace": ""}
    if port == EMULATOR:
        values["touched"] = "object = {mesh}   # what the emulated machine touches\nunits = {units}\n".format(**values)
        values["pace"] = "pace = 10   # the emulated machine is so many times faster than a real one\n"
    values |= {"file": SCENE_FILE, "title": _quoted(mesh.stem), "radius": _quoted(tip_radius)}
    values |= {"smallest": _quoted(f"{1e3 * smallest:.3g} mm"), "budget": _quoted(BUDGETS[finger])}

    def text(model_mesh: str, model_units: str) -> str:
        about = (_GRBL if finger == "grbl" else _SIMULATED).format(**values)
        return _SCENE.format(**values, finger=about, model_mesh=_quoted(model_mesh), model_units=_quoted(model_units))

    copy, part = folder / mesh.name, folder / f"{mesh.stem}-from-above.ply"
    is_beside = copy.exists() and copy.samefile(mesh)
    refuse_to_replace([path] if is_beside else [path, copy])
    # read where it will stand, with the mesh where it is: nothing is written that cannot be used
    where_it_is = text(mesh.name, units).replace(values["mesh"], _quoted(mesh.resolve().as_posix()))
    body = parse_scene(where_it_is, path, files_from=[mesh]).base_surface()
    assert body is not None  # its model is a mesh
    above = body.face_normals[:, 2] > FROM_ABOVE
    if finger == "grbl" and not above.any():
        raise MeshFileError(f"{mesh}: no face of it can be touched from above, along z; turn the mesh")
    cut = finger == "grbl" and not above.all()
    if cut:
        refuse_to_replace([part])
    folder.mkdir(parents=True, exist_ok=True)
    if not is_beside:
        shutil.copyfile(mesh, copy)
    if cut:
        _write_mesh(part, Surface(body.vertices, body.faces[above]))
    path.write_text(text(part.name, "m") if cut else text(mesh.name, units))
    return path


def _write_mesh(path: Path, surface: Surface) -> None:
    """A PLY file, m, of the vertices that faces use."""
    import trimesh

    trimesh.Trimesh(surface.vertices, surface.faces, process=True).export(path)


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
