"""merge: a model meets later logs of the same object; by mesh and samples it is judged whether they are."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from explore3d import UserError
from explore3d.analysis import Progress, Stages, build_model, silent
from explore3d.jobs.analyze import digest_of, table_words
from explore3d.jobs.conclude import write_table
from explore3d.jobs.objects import unlike
from explore3d.jobs.session import Job, Session
from explore3d.log import load_logs
from mapping.model import ObjectModel, merge_model


def load(path: Path | str) -> ObjectModel:
    """The annotated model that a job left: of its folder, or of its model.json.

    Raises:
        ModelError: there is none, or one that cannot be read.
    """
    return ObjectModel.load(path)


def merge(
    model: Path | str,
    logs: Sequence[Path | str],
    out: Path | str,
    pose_sd: float = 0.0,
    overwrite: bool = False,
    *,
    progress: Progress = silent,
    tip_radius: str | float | None = None,
    **table: Any,
) -> ObjectModel:
    """Analyse logs on a model's base, join what they hold with what it knows, and save the result.

    Args:
        model: folder or model.json of the known model; it is not changed.
        logs: later recordings of the same object in the same frame, whatever analyze takes, each analysed on its own.
        out: folder for the merged model; may be the model's own, whose other files then stay.
        pose_sd: standard deviation of the pose between the logs, m.
        overwrite: replace, once this one is complete, a session of something else in that folder.
        progress: told the stage and the share of it that is done.
        tip_radius, table: of recordings that do not state it, as for analyze.

    Raises:
        ModelError: a model that cannot be read.
        UserError: a log that cannot be read, is in the model already (it would count twice) or shows another
            object, or a folder that cannot be written.
    """
    own = Path(model).resolve() in (Path(out).resolve(), Path(out).resolve() / "model.json")
    keep = [path for path in Path(out).rglob("*") if path.is_file()] if own else []
    subject = digest_of([Path(model) / "model.json" if Path(model).is_dir() else Path(model), *logs])
    words = ["explore3d", "merge", str(model), *map(str, logs), "--out", str(out), "--pose-sd", f"{pose_sd:g} m"]
    words += table_words(tip_radius, table)
    job = Job("merge", subject, again=shlex.join(words))
    with Session(out, job, keep=keep, overwrite=overwrite) as session:
        known = _merged(model, logs, pose_sd, {"tip_radius": tip_radius} | table, progress)
        with session.staging() as folder:
            known.save(folder)
            write_table(known, folder)
    return known


def _merged(
    model: Path | str, logs: Sequence[Path | str], pose_sd: float, settings: dict[str, Any], progress: Progress
) -> ObjectModel:
    known = ObjectModel.load(model)
    for path in logs:
        log = load_logs([path], **settings)
        said = known.provenance
        if log.sha256 in (said.get("log_sha256"), *said.get("merged_sha256", [])):
            raise UserError(f"{path}: this log is in the model {model} already; merged twice it would count twice")
        if log.felt_sha256 in (said.get("felt_sha256"), *said.get("merged_felt_sha256", [])):
            raise UserError(
                f"{path}: another file, but its samples are in the model {model} already and would count twice; a "
                "simulation that is run again with its seed feels the same: give it another seed"
            )
        if complaint := unlike(log, known.base, pose_sd):
            raise UserError(f"{path}: not a log of the object of {model}, or not in its frame: {complaint}")
        analysis = build_model(log, None, known.base, Stages(progress))
        known = merge_model(known, analysis.model.features, "/".join(Path(path).resolve().parts[-2:]), pose_sd)
        about = dict(known.provenance)
        about["merged_sha256"] = [*about.get("merged_sha256", []), log.sha256]
        about["merged_felt_sha256"] = [*about.get("merged_felt_sha256", []), log.felt_sha256]
        known = replace(known, provenance=about)
    return known
