"""A scene of a sphere that a tip is calibrated on."""

from __future__ import annotations

from pathlib import Path

import trimesh

RADIUS = 0.0125
SCENE = """
schema = "explore3d/scene/1"
[tip]
radius = "10 mm"
[model]
mesh = "sphere.ply"
units = "mm"
[finger]
object = "sphere.ply"
units = "mm"
{finger}
[survey]
smallest_feature = "1 mm"
speed = "30 mm/s"
"""


def sphere_scene(folder: Path, finger: str, fineness: int = 5) -> Path:
    """The scene's path, beside its mesh; `finger` are the further lines of its table of that name.

    Args:
        fineness: subdivisions of an icosahedron: at 5 the flat faces lie up to 2 um inside the sphere.
    """
    trimesh.creation.icosphere(subdivisions=fineness, radius=1e3 * RADIUS).export(folder / "sphere.ply")
    path = folder / "scene.toml"
    path.write_text(SCENE.format(finger=finger))
    return path
