"""merge: a model meets later logs of the same object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from explore3d.build_model import build_model
from explore3d.errors import FolderError, UserError
from explore3d.log_reader import read_log
from explore3d.same_object import unlike
from explore3d.stages import Stages
from mapping.merging import merge_model
from mapping.object_model import ObjectModel


def merge(model: Path | str, logs: Sequence[Path | str], out: Path | str, pose_sd: float = 0.0) -> ObjectModel:
    """Analyse logs on a model's base, join what they hold with what it knows, and save the result.

    Args:
        model: folder or model.json of the known model; it is not changed.
        logs: later logs of the same object in the same frame, each analysed on its own.
        out: folder for the merged model; may be the model's own.
        pose_sd: standard deviation of the pose between the logs, m.

    Raises:
        ModelError: a model that cannot be read.
        UserError: a log that cannot be read, is in the model already (it would count twice) or shows another
            object, or a folder that cannot be written.
    """
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
    try:
        known.save(out)
    except OSError as error:
        raise FolderError(f"{out}: cannot write the merged model: {error.strerror or error}") from error
    return known
