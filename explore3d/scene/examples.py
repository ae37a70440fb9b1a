"""Examples: the scenes that come with the program, and what somebody begins from."""

from __future__ import annotations

import re
import shutil
import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from explore3d import FolderError, SceneError

SCENE_FILE = "scene.toml"
_INSTALLED = "share/explore3d"  # where an installed wheel keeps them, below the environment


@dataclass(frozen=True)
class Example:
    """A scene that comes with the program.

    Args:
        name: what commands call it.
        title: what the scene calls itself.
        scene: its file; its meshes lie beside or below it as it says.
    """

    name: str
    title: str
    scene: Path


def examples() -> dict[str, Example]:
    """The examples by name, in the order of the alphabet.

    Raises:
        FolderError: the installation lacks them.
    """
    scenes = sorted((_place() / "scenes").glob("*.toml"))
    return {path.stem: Example(path.stem, tomllib.loads(path.read_text())["title"], path) for path in scenes}


def example(name: str) -> Example:
    """One example.

    Raises:
        SceneError: there is none of that name.
        FolderError: the installation lacks them.
    """
    known = examples()
    if name not in known:
        raise SceneError(f"example {name!r}: there is none of that name; possible: {', '.join(known)}")
    return known[name]


def programs() -> Path | None:
    """The folder of the programs to begin from, docs/examples.md; None if the installation lacks them."""
    place = _place()
    folder = (place.parent if place.name == "assets" else place) / "examples"
    return folder if folder.is_dir() else None


def copy_example(name: str, folder: Path) -> list[Path]:
    """Copy an example to change it: its scene as scene.toml, and its meshes beside that.

    Returns:
        the files that were written, the scene first.

    Raises:
        SceneError: there is no example of that name.
        FolderError: one of the files is there already; nothing is written then.
    """
    source = example(name).scene
    text = source.read_text()
    meshes = sorted(set(re.findall(r'"(\.\./meshes/[^"]+)"', text)))
    for mesh in meshes:
        text = text.replace(f'"{mesh}"', f'"{Path(mesh).name}"')
    copies = [folder / Path(mesh).name for mesh in meshes]
    refuse_to_replace([folder / SCENE_FILE, *copies])
    folder.mkdir(parents=True, exist_ok=True)
    for mesh, copy in zip(meshes, copies, strict=True):
        shutil.copyfile(source.parent / mesh, copy)
    (folder / SCENE_FILE).write_text(text)
    return [folder / SCENE_FILE, *copies]


def refuse_to_replace(paths: list[Path]) -> None:
    """Raise FolderError if one of these files is there already."""
    for path in paths:
        if path.exists():
            raise FolderError(f"{path}: is there already and is not written over; give another folder")


@cache
def _place() -> Path:
    """The folder with `scenes` and `meshes`: that of a checkout, else that of the installed wheel."""
    checkout = Path(__file__).parents[2] / "assets"
    if (checkout / "scenes").is_dir():
        return checkout
    from importlib.metadata import PackageNotFoundError, files

    try:
        installed = files("explore3d") or []
    except PackageNotFoundError:
        installed = []
    for file in installed:
        if f"{_INSTALLED}/scenes/" in file.as_posix():
            return Path(str(file.locate())).resolve().parents[1]
    raise FolderError(f"{checkout}: the examples are not there; install explore3d again (pip install explore3d)")
