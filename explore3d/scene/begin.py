"""A scene to begin from, for somebody's own mesh, tip and finger."""

from __future__ import annotations

import shutil
from pathlib import Path

from explore3d import parse_length
from explore3d.scene.examples import SCENE_FILE, refuse_to_replace
from explore3d.scene.machine import EMULATOR
from explore3d.scene.scene import parse_scene

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
"""

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

{finger}
[survey]
smallest_feature = {smallest}   # the lowest crest that must not be missed
speed = "20 mm/s"
force = "1 N"

[explore]
time_budget = "10 min"
"""


def begin_scene(
    folder: Path, mesh: Path, units: str, tip_radius: str, finger: str = "simulated", port: str = EMULATOR
) -> Path:
    """Write a scene for a mesh, and a copy of that mesh beside it; the scene's path.

    What is not asked follows from the tip: details from a thirtieth of its radius, noise of a tenth of that.

    Args:
        folder: where it belongs; made if it is not there.
        mesh: the global model.
        units: unit of length of that file.
        tip_radius: of the spherical tip, such as "5 mm".
        finger: "simulated" or "grbl".
        port: of a Grbl machine.

    Raises:
        UnitError, SceneError, MeshFileError: a value, or the mesh, is none.
        FolderError: a scene, or another mesh of that name, is there already; nothing is written then.
    """
    path = folder / SCENE_FILE
    radius = parse_length(tip_radius)
    smallest = radius / 30.0
    values = {"mesh": _quoted(mesh.name), "units": _quoted(units), "white": _quoted(f"{1e6 * smallest / 10.0:.3g} um")}
    values["port"] = _quoted(port)
    touched = "object = {mesh}   # what the emulated machine touches\nunits = {units}\n".format(**values)
    values["touched"] = touched if port == EMULATOR else ""
    text = _SCENE.format(
        file=SCENE_FILE,
        title=_quoted(mesh.stem),
        radius=_quoted(tip_radius),
        mesh=values["mesh"],
        units=values["units"],
        finger=(_GRBL if finger == "grbl" else _SIMULATED).format(**values),
        smallest=_quoted(f"{1e3 * smallest:.3g} mm"),
    )
    copy = folder / mesh.name
    is_beside = copy.exists() and copy.samefile(mesh)
    refuse_to_replace([path] if is_beside else [path, copy])
    # read where it will stand, with the mesh where it is: nothing is written that cannot be used
    where_it_is = text.replace(values["mesh"], _quoted(mesh.resolve().as_posix()))
    parse_scene(where_it_is, path, files_from=[mesh] if mesh.exists() else ()).base_surface()
    folder.mkdir(parents=True, exist_ok=True)
    if not is_beside:
        shutil.copyfile(mesh, copy)
    path.write_text(text)
    return path


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
