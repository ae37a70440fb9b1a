"""Conclude: the model of a log is built and written, with its pictures and report, into a session's folder."""

from __future__ import annotations

from dataclasses import replace

from explore3d.analysis import Analysis, Forecast, Stages, build_model, forecast, worst_errors
from explore3d.jobs.session import Session
from explore3d.log import Log
from explore3d.report import write_report
from explore3d.scene import Scene
from mapping.base import Base


def conclude(
    session: Session, log: Log, scene: Scene | None, base: Base | None, stages: Stages, go_on: str = ""
) -> Analysis:
    """Build the model of a log and write it, with its pictures and report, into a session's folder.

    Args:
        go_on: the command that goes on with an exploration that ended early.
    """
    analysis = replace(build_model(log, scene, base, stages), go_on=go_on)
    with session.staging() as folder:
        with stages.stage("report"):
            write_report(analysis, folder, stages.is_forced("rendered pictures"))
        about = {"forecast": forecast(analysis), "errors": worst_errors(analysis.errors)}
        known = {name: each.record() if isinstance(each, Forecast) else each for name, each in about.items() if each}
        provenance = analysis.model.provenance | known
        model = replace(analysis.model, provenance=provenance, timings=dict(stages.timings))
        model.save(folder)
    return replace(analysis, model=model, timings=dict(stages.timings))
