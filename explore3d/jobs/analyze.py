"""analyze: recordings become the annotated model and its report."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

from explore3d import parse_length
from explore3d.analysis import Analysis, Progress, Stages, build_model, silent
from explore3d.jobs.conclude import conclude
from explore3d.jobs.session import Session
from explore3d.log import large_log, load_logs, read_base
from explore3d.scene import load_mesh, parse_scene
from mapping.base import Base


def analyze(
    logs: Sequence[Path | str] | Path | str,
    out: Path | str | None = None,
    *,
    tip_radius: str | float | None = None,
    model: Path | str | None = None,
    model_units: str = "m",
    progress: Progress = silent,
    force: Collection[str] = (),
    **table: Any,
) -> Analysis:
    """Build the annotated model of what was recorded.

    Args:
        logs: MCAP logs, folders of sessions, or tables of positions; of one object and one fingertip.
        out: folder for model and report; None writes nothing.
        tip_radius: of a table: "2 um", or metres.
        model: mesh file of the global model; None takes the one in the log, else fits one.
        model_units: of that file.
        progress: told the stage and the share of it that is done.
        force: stages to run although the recording does not need them.
        table: units, columns, frame, jump, reference of a table (explore3d.log.table.read_table).

    Raises:
        UserError: input that cannot be used, named by file and field.
    """
    paths = [logs] if isinstance(logs, str | Path) else list(logs)
    if len(paths) == 1 and (large := large_log(paths[0])) is not None:
        from explore3d.jobs.streaming import analyze_stream

        given = None if model is None else Base(load_mesh(model, model_units))
        radius = None if tip_radius is None else parse_length(tip_radius)
        return analyze_stream(large, out, base=given, tip_radius=radius, progress=progress, force=force)
    stages = Stages(progress, force)
    with stages.stage("reading"):
        log = load_logs(paths, tip_radius=tip_radius, **table)
        scene = parse_scene(log.scene_text, log.sources[0]) if log.scene_text else None
        base = Base(load_mesh(model, model_units)) if model is not None else read_base(log.events)
    if out is None:
        return build_model(log, scene, base, stages)
    with Session(out, keep=log.sources) as session:
        return conclude(session, log, scene, base, stages)
