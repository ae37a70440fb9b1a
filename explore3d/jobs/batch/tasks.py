"""Tasks: which logs a batch is of, from patterns and manifests, and what each is told."""

from __future__ import annotations

import csv
import glob
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from explore3d import UserError
from explore3d.jobs import Told, log_path
from explore3d.jobs.batch.places import files_of, is_remote
from explore3d.log import LOG

# Columns of a manifest that say how to read and analyse the row's file; names and values as the options of analyze
SETTING_COLUMNS = (
    "tip_radius", "tip_sd", "form", "mask", "units", "columns", "pixel", "part", "frame", "reference", "jump",
    "model", "model_units",
)  # fmt: skip
MANIFEST_COLUMNS = ("file", "object", *SETTING_COLUMNS)


@dataclass(frozen=True)
class Task:
    """One log of a batch.

    Args:
        log: its path, or its address in an object store.
        told: how to read and analyse it.
        object: a name for what was felt, "" if nobody gave one.
    """

    log: str
    told: Told = field(default_factory=Told)
    object: str = ""

    def record(self) -> dict[str, Any]:
        """The task in JSON's types, for another process."""
        told = {name: getattr(self.told, name) for name in ("tip_radius", "model", "model_units", "force", "quick")}
        told["model"] = None if told["model"] is None else str(Path(told["model"]).resolve())
        place = self.log if is_remote(self.log) else str(Path(self.log).resolve())
        return {"log": place, "object": self.object, "told": told | {"table": dict(self.told.table)}}

    @classmethod
    def read(cls, record: dict[str, Any]) -> Task:
        """The task that a record describes."""
        told = record["told"]
        return cls(record["log"], Told(**told | {"force": tuple(told["force"])}), record["object"])


def tasks_of(patterns: Sequence[str], told: Told, manifest: Path | str | None = None) -> list[Task]:
    """A task for each log that the patterns name, then one for each row of the manifest; none twice by its path.

    Args:
        patterns: paths, folders (of a session: its log; else each file in it), patterns (`scans/**/*.csv`), and
            addresses that fsspec knows (`s3://bucket/*.mcap`).
        told: what all are told; a row of the manifest may say otherwise.
        manifest: CSV with a column `file` (relative to it), and any of `object` and SETTING_COLUMNS.

    Raises:
        UserError: a pattern that names nothing, or a manifest that cannot be read.
    """
    tasks = [Task(path, told) for pattern in patterns for path in _logs(pattern)]
    if manifest is not None:
        tasks += _rows(Path(manifest), told)
    if not tasks:
        raise UserError("no log was named; name files, patterns, or a --manifest")
    return list({task.log: task for task in tasks}.values())


def _logs(pattern: str) -> list[str]:
    """The logs behind a pattern, in the order of their names."""
    if is_remote(pattern):
        found = files_of(pattern)
    elif Path(pattern).is_dir():
        whole = log_path(pattern)
        found = [str(whole)] if whole.name == LOG and whole.is_file() else _recordings(Path(pattern))
    elif Path(pattern).is_file():
        found = [pattern]
    else:
        found = sorted(path for path in glob.glob(pattern, recursive=True) if _is_recording(Path(path)))
    if not found:
        raise UserError(f"{pattern}: names no file; a file, a folder with files in it, or a pattern in quotes does")
    return found


def _recordings(folder: Path) -> list[str]:
    return sorted(str(path) for path in folder.iterdir() if _is_recording(path))


def _is_recording(path: Path) -> bool:
    """False for folders, hidden files, and what says how to read another (a sidecar, a scene)."""
    return not path.is_dir() and not path.name.startswith(".") and path.suffix != ".toml"


def _rows(manifest: Path, told: Told) -> list[Task]:
    try:
        with manifest.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file, skipinitialspace=True)
            names, rows = [name.strip() for name in reader.fieldnames or []], list(reader)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise UserError(
            f"{manifest}: cannot be read as a manifest: {getattr(error, 'strerror', None) or error}"
        ) from error
    unknown = [name for name in names if name not in MANIFEST_COLUMNS]
    if "file" not in names or unknown:
        what = f"unknown column {unknown[0]!r}" if unknown else "no column 'file'"
        raise UserError(f"{manifest}: {what}; a manifest is CSV with the columns {', '.join(MANIFEST_COLUMNS)}")
    tasks = []
    for number, row in enumerate(rows, 2):
        said = {name: value.strip() for name, value in row.items() if isinstance(value, str) and value.strip()}
        if None in row or "file" not in said:
            raise UserError(f"{manifest}: line {number}: {'too many values' if None in row else 'no file is named'}")
        tasks.append(_task(manifest, said, told))
    return tasks


def _task(manifest: Path, said: dict[str, str], told: Told) -> Task:
    name = said.pop("file")
    place = name if is_remote(name) or Path(name).is_absolute() else str(manifest.parent / name)
    label, changes = said.pop("object", ""), dict[str, Any]()
    for field_name in ("tip_radius", "model", "model_units"):
        if field_name in said:
            changes[field_name] = said.pop(field_name)
    if "model" in changes and not Path(changes["model"]).is_absolute():
        changes["model"] = str(manifest.parent / changes["model"])
    table: dict[str, Any] = dict(said)
    if "mask" in table:
        table["mask"] = [each.strip() for each in table["mask"].split(";")]
    if "frame" in table:
        table["frame"] = {"origin": [each.strip() for each in table["frame"].split(",")]}
    return Task(place, replace(told, table={**told.table, **table}, **changes), label)
