"""Streaming: the analysis of a log too large for memory, by whole sweeps, in bounded memory, resumable."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

from explore3d.analysis import Analysis, Stages, build_model
from explore3d.jobs.conclude import conclude
from explore3d.jobs.condense import CHUNK, KEPT_BACKGROUND_SAMPLES, Condensed, condense
from explore3d.jobs.session import Session
from explore3d.log import Log, LogStream, count_samples, digest, head, read_base
from explore3d.scene import AnalysisSettings, recorded_scene
from mapping import LeftOut, Trace
from mapping.base import Base, fit_base
from mapping.model import Tolerance


def analyze_stream(
    path: Path,
    session: Session | None,
    stages: Stages,
    *,
    base: Base | None = None,
    tip_radius: float | None = None,
    tolerances: tuple[Tolerance, ...] | None = None,
    chunk: int = CHUNK,
    report: bool = True,
    run: str = "",
) -> Analysis:
    """The annotated model of one large log; arguments and errors as for explore3d.jobs.analyze.analyze.

    What came of each chunk stays in `<out>.chunks` until the whole is done: a rerun takes it from there.

    Args:
        session: entered, for model and report; None writes nothing.
        stages: the account of what runs and what is left out.
        tolerances: what the drawing allows; None: what the scene says.
        report, run: as for conclude.
    """
    scene_text, events = head(path)
    scene = recorded_scene(scene_text, path) if scene_text else None
    base = base or read_base(events) or _fitted(path, tip_radius, stages)
    settings = AnalysisSettings.of(scene)
    out = None if session is None else session.folder.resolve()
    folder = None if out is None else out.with_name(out.name + ".chunks")
    stream = LogStream(path, tip_radius)
    with stages.stage("detection") as share:
        condensed = condense(stream, base, folder, share, chunk, **settings.detection)
    log = replace(_log(path, scene_text, condensed), tolerances=tolerances)
    far = condensed.samples - len(condensed.trace)
    searched = f"all {condensed.samples:,} samples were searched; {far:,} of them, away from crossings, were not kept"
    stages.left_out.append(LeftOut("part of the trace", searched))
    if session is None:
        return build_model(log, scene, base, stages)
    analysis = conclude(session, log, scene, base, stages, report=report, run=run)
    if folder is not None:
        shutil.rmtree(folder, ignore_errors=True)
    return analysis


def _log(path: Path, scene_text: str, condensed: Condensed) -> Log:
    return Log(
        trace=condensed.trace,
        scene_text=scene_text,
        events=condensed.events,
        complete=condensed.complete,
        recovered=condensed.recovered,
        sha256=digest(path),
        sources=(str(path),),
        detections=condensed.detections,
    )


def _fitted(path: Path, tip_radius: float | None, stages: Stages) -> Base:
    """The base of a log that has none, from a first pass over every k-th sample."""
    every, total, done = max(1, round(count_samples(path) / KEPT_BACKGROUND_SAMPLES)), max(count_samples(path), 1), 0
    parts = []
    with stages.stage("base fit") as share:
        for trace in LogStream(path, tip_radius).sweeps(CHUNK):
            parts.append(trace.select(slice(None, None, every)))
            done += len(trace)
            share(0.9 * min(1.0, done / total))
        return fit_base(Trace.concatenate(parts))
