"""One log of a batch: its run and its features as rows, whatever becomes of it."""

from __future__ import annotations

import json
import time
import traceback
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from explore3d import UserError, __version__
from explore3d.analysis import Analysis, feature_rows, run_key
from explore3d.jobs import analyze
from explore3d.jobs.batch.places import local, sha256_of
from explore3d.jobs.batch.store import RUN_COLUMNS
from explore3d.jobs.batch.tasks import Task
from hw import FingerError, MoveError
from mapping import MappingError
from mapping.model import overall
from planners import PlannerError

# What a user can mend, in one line
REFUSALS = (UserError, MappingError, PlannerError, MoveError, FingerError)


@dataclass(frozen=True)
class Job:
    """A task whose log's bytes are known.

    Args:
        task: which log, and what it is told.
        sha256: of its bytes, "" if they cannot be read.
        settings: all that decides what comes of them.
        models: folder for a folder with model and report of each run, None for none.
    """

    task: Task
    sha256: str
    settings: dict[str, Any]
    models: str | None = None

    @classmethod
    def of(cls, task: Task, models: str | None = None) -> Job:
        """The job of a task.

        Raises:
            OSError: the log cannot be read.
            UserError: its sidecar cannot be.
        """
        return cls(task, sha256_of(task.log), task.told.record([task.log]), models)

    @property
    def run(self) -> str:
        """The key of the run."""
        return run_key(self.sha256, self.settings)

    def record(self) -> dict[str, Any]:
        """The job in JSON's types, for another process."""
        return {"task": self.task.record(), "sha256": self.sha256, "settings": self.settings, "models": self.models}

    @classmethod
    def read(cls, record: dict[str, Any]) -> Job:
        """The job that a record describes."""
        return cls(Task.read(record["task"]), record["sha256"], record["settings"], record["models"])

    def row(self, status: str, reason: str = "", **known: Any) -> dict[str, Any]:
        """The run's row: how it ended, and what is known of it."""
        about = {
            "run": self.run,
            "log": self.task.log,
            "object": self.task.object or None,
            "sha256": self.sha256 or None,
            "version": __version__,
            "settings": json.dumps(self.settings, sort_keys=True, default=str),
            "status": status,
            "reason": " ".join(reason.split()) or None,
            "finished": datetime.now(UTC).isoformat(timespec="milliseconds"),
        }
        return dict.fromkeys(RUN_COLUMNS) | about | known


def carried_out(job: Job) -> dict[str, Any]:
    """Analyse a log: {"run": row, "features": rows}; a refusal or a fault of the program becomes a row, too."""
    began = time.perf_counter()
    try:
        row, features = _analysed(job)
    except REFUSALS as error:
        row, features = job.row("refused", str(error)), []
    except MemoryError as error:
        row, features = job.row("out of memory", f"the memory that was allowed did not do: {error}"), []
    except OSError as error:
        row, features = job.row("unreadable", str(error)), []
    except Exception as error:  # a fault of the program costs this log alone, and says where it is
        place = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(place.filename).name}, line {place.lineno}"
        row, features = job.row("crashed", f"{type(error).__name__}: {error} ({where})"), []
    row["seconds"] = round(time.perf_counter() - began, 3)
    return {"run": row, "features": features}


def _analysed(job: Job) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    told = job.task.told
    out = None if job.models is None else Path(job.models) / job.run
    with local(job.task.log) as path:
        analysis = analyze(
            [path],
            out,
            tip_radius=told.tip_radius,
            model=told.model,
            model_units=told.model_units,
            force=told.force,
            overwrite=True,
            quick=told.quick,
            **told.table,
        )
    return job.row("done", **_known(analysis)), feature_rows(analysis.model, job.run)


def _known(analysis: Analysis) -> dict[str, Any]:
    detections = analysis.detections
    noise, limit = detections.noise, float(detections.detection_limit)
    told = analysis.refuted_tip, analysis.side, analysis.sparse
    of_tip = [each.sentence() for each in told if each is not None]
    return {
        "samples": int(analysis.model.provenance["samples"]),
        "features": len(analysis.model.features),
        "tip_radius": float(analysis.trace.tip_radius),
        "noise_white": float(noise.white),
        "noise_correlated": float(noise.correlated),
        "noise_length": float(noise.length),
        "detection_limit": limit if limit < float("inf") else None,
        "base": analysis.base.kind,
        "tolerances": overall([each.verdict for each in analysis.judgements]) or None,
        "warnings": "; ".join((*of_tip, *detections.remarks)) or None,
    }
