"""A scene to begin from, for somebody's own mesh, tip and finger."""

from __future__ import annotations

import shutil
from pathlib import Path

from explore3d import MeshFileError, UnitError, parse_length, unit_factor
from explore3d.scene.examples import SCENE_FILE, refuse_to_replace
from explore3d.scene.machine import EMULATOR, MIDDLE_OF_TRAVEL
from explore3d.scene.scene import parse_scene
from mapping.geometry.mesh import asked_part

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
origin = {origin}   # where the object stands in machine coordinates
touch = "peck"
step = "0.5 mm"
{pace}"""

_FROM_ABOVE = 'sides = ["+z"]   # what of it faces the machine; the ways lead round the whole\n'

_SCENE = """\
# Every key is explained in docs/scene.md; `explore3d plan {file}` shows the sweeps before anything moves.
schema = "explore3d/scene/1"
title = {title}
seed = 1

[tip]
radius = {radius}

# The global model: what is known of the object beforehand.
[model]
mesh = {mesh}
units = {units}
{sides}
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


def begin_scene(
    folder: Path, mesh: Path, units: str, tip_radius: str, finger: str = "simulated", port: str = EMULATOR
) -> Path:
    """Write a scene for a mesh, and a copy of that mesh beside it; the scene's path.

    What is not asked follows from the tip: details from a thirtieth of its radius (a tenth for a Grbl machine), noise
    of a tenth of that. A Grbl machine comes from above: what of the mesh faces there is explored, and the
    ways lead round the whole of it.

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
    path, radius = folder / SCENE_FILE, parse_length(tip_radius)
    if not radius > 0:
        raise UnitError(f"tip_radius: should be greater than 0; found {tip_radius!r}")
    unit_factor(units)
    smallest = SMALLEST[finger] * radius
    values = {"mesh": _quoted(mesh.name), "units": _quoted(units), "white": _quoted(f"{1e6 * smallest / 10.0:.3g} um")}
    origin = f"[{', '.join(map(_quoted, MIDDLE_OF_TRAVEL))}]"
    values |= {"port": _quoted(port), "origin": origin, "touched": "", "pace": ""}
    if port == EMULATOR:
        values["touched"] = "object = {mesh}   # what the emulated machine touches\nunits = {units}\n".format(**values)
        values["pace"] = "pace = 10   # the emulated machine is so many times faster than a real one\n"
    values |= {"file": SCENE_FILE, "title": _quoted(mesh.stem), "radius": _quoted(tip_radius)}
    values |= {"smallest": _quoted(f"{1e3 * smallest:.3g} mm"), "budget": _quoted(BUDGETS[finger])}

    about = (_GRBL if finger == "grbl" else _SIMULATED).format(**values)
    text = _SCENE.format(**values, finger=about, sides=_FROM_ABOVE if finger == "grbl" else "")
    copy = folder / mesh.name
    is_beside = copy.exists() and copy.samefile(mesh)
    refuse_to_replace([path] if is_beside else [path, copy])
    # read where it will stand, with the mesh where it is: nothing is written that cannot be used
    where_it_is = text.replace(values["mesh"], _quoted(mesh.resolve().as_posix()))
    scene = parse_scene(where_it_is, path, files_from=[mesh])
    body = scene.base_surface()
    assert body is not None  # its model is a mesh
    if asked_part(body, **scene.model.asked) is None:
        raise MeshFileError(f"{mesh}: no face of it can be touched from above, along z; turn the mesh")
    folder.mkdir(parents=True, exist_ok=True)
    if not is_beside:
        shutil.copyfile(mesh, copy)
    path.write_text(text)
    return path


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
