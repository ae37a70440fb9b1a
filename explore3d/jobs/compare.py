"""compare: two scans of one object, models or logs: what is new, gone, grown, shrunk or moved, and how bases differ."""

from __future__ import annotations

import json
import shlex
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from explore3d import UserError
from explore3d.analysis import Progress, silent
from explore3d.jobs.analyze import Told, analyze, digest_of, log_path
from explore3d.jobs.session import Job, Session
from explore3d.log import LOG
from mapping import FloatArray, length_text
from mapping.model import Comparison, ObjectModel, Registration, compare_models

COMPARISON = "comparison.json"
COMPARISON_SCHEMA = "explore3d/comparison/1"
# A file that did not grow between two looks so far apart is whole, s
LOOK_EVERY = 1.0


@dataclass(frozen=True, eq=False)
class Compared:
    """Two scans, and what changed from the first to the second.

    Args:
        first, second: paths of the two.
        comparison: the changes, and how the frames lie to each other.
        model: the first scan's model with the map of how far the second's base stands off its own.
    """

    first: str
    second: str
    comparison: Comparison
    model: ObjectModel

    def record(self) -> dict[str, Any]:
        """The result in JSON's types; lengths in m, angles in rad."""
        motion, off = self.comparison.registration, self.model.deviation
        known = np.zeros(0) if off is None else off[np.isfinite(off)]
        return {
            "schema": COMPARISON_SCHEMA,
            "first": self.first,
            "second": self.second,
            "registration": {
                "shift": motion.shift.tolist(),
                "rotation": motion.rotation.tolist(),
                "centre": motion.centre.tolist(),
                "sd": np.sqrt(np.diag(motion.covariance)).tolist(),
                "pairs": motion.pairs,
            },
            "changes": [change.record() for change in self.comparison.changes],
            "unseen": list(self.comparison.unseen),
            "pairs": self.comparison.pairs,
            "deviation": {
                "rms": float(np.sqrt(np.mean(known**2))) if len(known) else None,
                "largest": float(np.abs(known).max()) if len(known) else None,
            },
        }


def compare(
    first: Path | str,
    second: Path | str,
    out: Path | str | None = None,
    *,
    told: Told | None = None,
    most_shift: float | None = None,
    overwrite: bool = False,
    progress: Progress = silent,
) -> Compared:
    """What changed between two scans of one object.

    Args:
        first, second: models (folder of a session, model.json) or logs, which are analysed first.
        out: folder for comparison.json, and the first's model with the map of deviations; None writes nothing.
        told: how to read logs.
        most_shift: the largest shift between their frames that is looked for, m; None: a tenth of the object.
        overwrite: replace a session of something else in that folder.
        progress: told the stage and the share of it that is done.

    Raises:
        UserError, ModelError: a model or log that cannot be read, or a folder that cannot be written.
    """
    told = Told(quick=True) if told is None else told
    if out is None:
        return _compared(first, second, told, most_shift, progress)
    words = ["explore3d", "compare", str(first), str(second), "--out", str(out)]
    job = Job("compare", digest_of([_file(first), _file(second)]), again=shlex.join(words))
    with Session(out, job, overwrite=overwrite) as session:
        found = _compared(first, second, told, most_shift, progress)
        with session.staging() as folder:
            found.model.save(folder)
            (folder / COMPARISON).write_text(json.dumps(found.record(), indent=1) + "\n", "utf-8")
    return found


def watched(
    folder: Path,
    sleep: Callable[[float], None] = time.sleep,
    idle: float | None = None,
) -> Iterator[Path]:
    """The recordings that appear in a folder, each as soon as it is whole; those that are there first, by name.

    Args:
        folder: it is looked into every LOOK_EVERY seconds.
        sleep: waits so many seconds.
        idle: ends after so many seconds without a new one, None: never.
    """
    seen: set[Path] = set()
    sizes: dict[Path, tuple[int, float]] = {}
    waited = 0.0
    while idle is None or waited <= idle:
        for path in sorted(each for each in folder.iterdir() if not each.name.startswith(".") and each not in seen):
            file = log_path(path)
            if not file.is_file() or path.suffix == ".toml" or (path.is_dir() and file.name != LOG):
                continue
            about = file.stat().st_size, file.stat().st_mtime
            if sizes.get(path) == about:
                seen.add(path)
                waited = 0.0
                yield path
            sizes[path] = about
        sleep(LOOK_EVERY)
        waited += LOOK_EVERY


def _file(scan: Path | str) -> Path:
    model = Path(scan) / "model.json"
    return model if model.is_file() else Path(scan)


def _model(scan: Path | str, told: Told, progress: Progress) -> ObjectModel:
    path = _file(scan)
    if not path.exists():
        raise UserError(f"{scan}: neither a model nor a log: there is no such file")
    if path.name == "model.json":
        return ObjectModel.load(path)
    return analyze(
        [scan],
        tip_radius=told.tip_radius,
        model=told.model,
        model_units=told.model_units,
        force=told.force,
        quick=told.quick,
        progress=progress,
        **told.table,
    ).model


def _compared(
    first: Path | str, second: Path | str, told: Told, most_shift: float | None, progress: Progress
) -> Compared:
    one, other = _model(first, told, progress), _model(second, told, progress)
    if one.provenance.get("tip_radius") != other.provenance.get("tip_radius"):
        radii = [float(model.provenance.get("tip_radius", np.nan)) for model in (one, other)]
        here, there = (length_text(radius, 6) for radius in radii)  # two that differ by little are told apart
        raise UserError(f"{first} was felt with a tip of {here}, {second} with one of {there}: not comparable")
    comparison = compare_models(one, other, most_shift)
    if comparison.apart > 0.0:
        raise UserError(
            f"{first} and {second} have nothing in common to compare: no feature is in both, and their surfaces lie "
            f"{length_text(comparison.apart)} farther from each other than their frames may be shifted; possible are "
            "two scans of one object in one frame, or a larger --shift"
        )
    off = deviation(one, other, comparison.registration)
    return Compared(str(first), str(second), comparison, replace(one, deviation=off))


def deviation(first: ObjectModel, second: ObjectModel, motion: Registration) -> FloatArray:
    """(V,) by how much the second's base stands off the first's at its vertices, m; 0 where there is no second's."""
    vertices = first.base.surface.vertices
    there = (vertices - motion.centre - motion.shift) @ motion.rotation + motion.centre
    near = second.base.nearest.query(there)
    offset = there - near.points
    height = np.einsum("ij,ij->i", offset, near.normals)
    beside = np.linalg.norm(offset - height[:, None] * near.normals, axis=1)
    edge = np.linalg.norm(np.diff(second.base.surface.bounds, axis=0)) / np.sqrt(len(second.base.surface.faces))
    return np.asarray(np.where(beside < 0.5 * edge, -height, 0.0))
