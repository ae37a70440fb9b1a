"""Scenes in folders of a test's own, with copies of the shipped meshes that they name beside them."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

MESHES = Path(__file__).resolve().parents[2] / "assets" / "meshes"
NAMED = re.compile(rf"(?:\.\./meshes|{re.escape(str(MESHES))})/(\w+\.ply)")


def write_scene_file(path: Path, text: str) -> Path:
    """Write the text there; its meshes, in assets/meshes or beside it, are copied to a folder `meshes` beside it."""
    for name in set(NAMED.findall(text)):
        (path.parent / "meshes").mkdir(exist_ok=True)
        shutil.copyfile(MESHES / name, path.parent / "meshes" / name)
    path.write_text(NAMED.sub(r"meshes/\1", text))
    return path
