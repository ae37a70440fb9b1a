"""merge: a model meets later logs of the same object; by mesh and samples it is judged whether they are."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from explore3d import UserError
from explore3d.analysis import Stages, build_model
from explore3d.jobs.analyze import digest_of
from explore3d.jobs.session import Job, Session
from explore3d.log import Log, read_base, read_log
from mapping.base import Base
from mapping.model import ObjectModel, merge_model


def merge(
    model: Path | str, logs: Sequence[Path | str], out: Path | str, pose_sd: float = 0.0, overwrite: bool = False
) -> ObjectModel:
    """Analyse logs on a model's base, join what they hold with what it knows, and save the result.

    Args:
        model: folder or model.json of the known model; it is not changed.
        logs: later logs of the same object in the same frame, each analysed on its own.
        out: folder for the merged model; may be the model's own, whose other files then stay.
        pose_sd: standard deviation of the pose between the logs, m.
        overwrite: replace, once this one is complete, a session of something else in that folder.

    Raises:
        ModelError: a model that cannot be read.
        UserError: a log that cannot be read, is in the model already (it would count twice) or shows another
            object, or a folder that cannot be written.
    """
    own = Path(model).resolve() in (Path(out).resolve(), Path(out).resolve() / "model.json")
    keep = [path for path in Path(out).rglob("*") if path.is_file()] if own else []
    subject = digest_of([Path(model) / "model.json" if Path(model).is_dir() else Path(model), *logs])
    words = ["explore3d", "merge", str(model), *map(str, logs), "--out", str(out), "--pose-sd", f"{pose_sd:g} m"]
    job = Job("merge", subject, again=shlex.join(words))
    with Session(out, job, keep=keep, overwrite=overwrite) as session:
        known = _merged(model, logs, pose_sd)
        with session.staging() as folder:
            known.save(folder)
    return known


def _merged(model: Path | str, logs: Sequence[Path | str], pose_sd: float) -> ObjectModel:
    known = ObjectModel.load(model)
    for path in logs:
        log = read_log(path)
        seen = [known.provenance.get("log_sha256"), *known.provenance.get("merged_sha256", [])]
        if log.sha256 in seen:
            raise UserError(f"{path}: this log is in the model {model} already; merged twice it would count twice")
        if complaint := unlike(log, known.base, pose_sd):
            raise UserError(f"{path}: not a log of the object of {model}, or not in its frame: {complaint}")
        analysis = build_model(log, None, known.base, Stages())
        known = merge_model(known, analysis.model.features, "/".join(Path(path).resolve().parts[-2:]), pose_sd)
        hashes = [*known.provenance.get("merged_sha256", []), log.sha256]
        known = replace(known, provenance={**known.provenance, "merged_sha256": hashes})
    return known


# Two surfaces, or a trace and the base under it, may lie so far apart in tip radii, and in sds of the pose
MOST_SURFACE_GAP, POSE_SDS = 0.1, 3.0
# Samples, or faces, that are looked at
MOST_COMPARED_PLACES = 5000
# Share of the faces whose middles must lie on the other mesh: a border may be cut elsewhere
MATCHING_FACE_SHARE = 0.9


def unlike(log: Log, base: Base, pose_sd: float = 0.0) -> str:
    """Why a log cannot be of the object with that base; "" if nothing speaks against it.

    What lies on the base may differ: a log of a twin with other features cannot be told from a later look at this one.

    Args:
        log: a recording.
        base: of the model that it shall join.
        pose_sd: standard deviation of the pose between the two, m.
    """
    limit = MOST_SURFACE_GAP * log.trace.tip_radius + POSE_SDS * pose_sd
    own = read_base(log.events)
    if own is not None and own.kind == base.kind == "mesh":
        gap = max(_gap(own, base), _gap(base, own))
        if gap > limit:
            return (
                f"the mesh that it was recorded for lies {_mm(gap)} off the model's; at most {_mm(limit)} is possible"
            )
    some = np.linspace(0, len(log.trace) - 1, min(MOST_COMPARED_PLACES, len(log.trace))).astype(np.int64)
    height = base.foot(log.trace.centers[some], log.trace.tip_radius).height
    off = float(np.median(np.abs(height)))
    if off > limit:
        return f"half of its samples lie more than {_mm(off)} off the model's base; at most {_mm(limit)} is possible"
    return ""


def _gap(one: Base, other: Base) -> float:
    """Distance of a mesh from another that MATCHING_FACE_SHARE of its faces keep within, m."""
    middles = one.surface.vertices[one.surface.faces].mean(axis=1)
    some = middles[np.linspace(0, len(middles) - 1, min(MOST_COMPARED_PLACES, len(middles))).astype(np.int64)]
    return float(np.quantile(other.nearest.query(some).distance, MATCHING_FACE_SHARE))


def _mm(length: float) -> str:
    return f"{1e3 * length:.3g} mm"
