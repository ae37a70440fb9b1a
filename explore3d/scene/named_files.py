"""NamedFiles: the files that a scene may name, which lie near it unless a person says otherwise."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from explore3d import SceneError
from explore3d.scene.values import Table, is_informative

T = TypeVar("T", bound=Table)


@dataclass(frozen=True)
class NamedFiles:
    """Where the files of one scene may lie: a scene is data, perhaps somebody else's, and opens nothing far from it.

    That is its own folder, the folders beside that one, and all below them; links are followed first. Beside a folder
    at the root of a file system lies all of it: there only what is below counts.

    Args:
        scene: the scene's file.
        others: folders, or single files, that a person allows besides.

    Raises:
        SceneError: one of the others is not there.
    """

    scene: Path
    others: tuple[Path, ...] = ()

    @classmethod
    def of(cls, scene: Path, others: Collection[Path | str], held: Collection[Path] = ()) -> NamedFiles:
        """With the others as their links lead, and files that are `held` in memory and need not be there."""
        for other in others:
            if not Path(other).exists():
                raise SceneError(f"--files-from {other}: there is no such folder")
        return cls(scene, (*held, *(Path(other).resolve() for other in others)))

    def place(self, field: str, name: Path) -> Path:
        """Where a file of that name lies.

        Args:
            field: of the scene that names it.
            name: as it stands there; counts from the scene's folder.

        Raises:
            SceneError: that is none of the places where it may lie.
        """
        folder = self.scene.resolve().parent
        try:
            place = (folder / name).resolve()
        except (OSError, RuntimeError, ValueError) as error:  # links in a circle; characters that no name has
            raise SceneError(f"{self.scene}: {field}: {str(name)!r} is no file's name ({error})") from error
        near = not name.is_absolute() and (place.is_relative_to(folder) or _beside(place, folder))
        if near or any(place.is_relative_to(other) for other in self.others):
            return place
        raise SceneError(
            f"{self.scene}: {field}: {name} is {place}; a scene names files, by paths that count from it, in or below "
            f"its own folder or a folder beside that; if this one is meant, give --files-from {place.parent}"
        )


def with_files(table: T, change: Callable[[str, Path], Path], field: str = "") -> T:
    """The table with every file that it names changed, in its own tables, too.

    What no job reads only tells people where something came from, and stays.

    Args:
        table: a scene, or a table of it.
        change: gives the new path, from the field's name and the path.
        field: begins the fields' names.
    """

    def changed(value: object, name: str) -> object:
        if isinstance(value, Path):
            return change(name, value)
        if isinstance(value, Table):
            return with_files(value, change, f"{name}.")
        if isinstance(value, tuple | list):
            return type(value)(changed(each, name) for each in value)
        if isinstance(value, dict):
            return {key: changed(each, f"{name}.{key}") for key, each in value.items()}
        return value

    keys = type(table).model_fields
    read = [name for name in keys if not is_informative(keys[name])]
    return table.model_copy(update={name: changed(getattr(table, name), field + name) for name in read})


def _beside(place: Path, folder: Path) -> bool:
    """True if the place is in or below a folder beside that folder."""
    around = folder.parent
    return around.parent != around and place.is_relative_to(around) and len(place.relative_to(around).parts) > 1
