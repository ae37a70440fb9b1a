"""Conclude: the model of a log is built and written, with its pictures and report, into a session's folder."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from time import process_time

from explore3d.analysis import (
    FEATURE_COLUMNS,
    Analysis,
    Forecast,
    Stages,
    build_model,
    csv_text,
    feature_rows,
    forecast,
    parquet_bytes,
    worst_errors,
)
from explore3d.jobs.expedition import Waits
from explore3d.jobs.session import Session
from explore3d.log import Log
from explore3d.report import write_report
from explore3d.scene import Scene
from mapping.base import Base
from mapping.geometry.mesh import write_whole
from mapping.model import ObjectModel

# The table of features beside the model, for every program and for those that ask many at once
FEATURES_CSV, FEATURES_PARQUET = "features.csv", "features.parquet"


def conclude(
    session: Session,
    log: Log,
    scene: Scene | None,
    base: Base | None,
    stages: Stages,
    go_on: str = "",
    *,
    report: bool = True,
    run: str = "",
    waits: Waits | None = None,
) -> Analysis:
    """Build the model of a log and write it, with its table, pictures and report, into a session's folder.

    Args:
        report: False to leave pictures and report out.
        run: key of the analysis in the table.
        waits: of the finger that made the log; None if that was not now.
        go_on: the command that goes on with an exploration that ended early.
    """
    begin = process_time()
    analysis = replace(build_model(log, scene, base, stages), go_on=go_on)
    if waits is not None:
        analysis = replace(analysis, computing=waits.computing(process_time() - begin))
    with session.staging() as folder:
        if report:
            with stages.stage("report"):
                write_report(analysis, folder, stages.is_forced("rendered pictures"))
        write_table(analysis.model, folder, run)
        about = {"forecast": forecast(analysis), "errors": worst_errors(analysis.errors)}
        known = {name: each.record() if isinstance(each, Forecast) else each for name, each in about.items() if each}
        provenance = analysis.model.provenance | known
        model = replace(analysis.model, provenance=provenance, timings=dict(stages.timings))
        model.save(folder)
    return replace(analysis, model=model, timings=dict(stages.timings))


def write_table(model: ObjectModel, folder: Path, run: str = "") -> None:
    """Write the table of a model's features beside it.

    Args:
        run: key of the analysis; "": the model is not of one alone.
    """
    table = feature_rows(model, run)
    write_whole(folder / FEATURES_CSV, csv_text(FEATURE_COLUMNS, table))
    write_whole(folder / FEATURES_PARQUET, parquet_bytes(FEATURE_COLUMNS, table))
