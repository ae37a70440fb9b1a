"""build_model: the paper's method, one line a stage; each stage runs only where the recording needs it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from explore3d.analysis.method import (
    MethodStage,
    Work,
    assembled,
    believed,
    compared_in_time,
    curvature_taken,
    detected,
    deviated,
    fitted,
    inspected,
    kept_over_base,
    limit_measured,
    made_sound,
    modelled,
    placed,
    refined_all,
    roughness_taken,
    set_down,
    side_asked,
    sought_along,
    standard_heights_taken,
    standing_told,
    surface_estimated,
    tip_asked,
    tip_asked_of_lines,
    tip_counts,
    told_over_sheet,
    why_no_chain,
    why_no_contact_algorithms,
    why_no_curvature,
    why_no_detection,
    why_no_deviation,
    why_no_faint_lines,
    why_no_fit,
    why_no_injection,
    why_no_lines,
    why_no_pose,
    why_no_posterior,
    why_no_roughness,
    why_no_smoothing,
    why_no_standard_heights,
    why_no_surface,
    why_no_time_curve,
    why_no_yielding,
    yielded,
)
from explore3d.analysis.result import Analysis
from explore3d.analysis.savings import with_savings
from explore3d.analysis.stages import Stages
from explore3d.analysis.truth import compare
from explore3d.log import Log, stop_of
from explore3d.scene import Scene
from mapping.base import Base
from mapping.geometry.mesh import algebra_in_one_thread


def _never(work: Work) -> bool:
    return False


# The method, in order: what a stage is called, why it is left out ("" if it runs), what it does, and whether it can be
# forced where it is not needed. A stage without a name is too short to be timed; one without a function is a part of
# another, which looks up whether it was asked for.
METHOD = (
    MethodStage("base fit", why_no_fit, fitted),
    MethodStage("pose", why_no_pose, placed, possible=lambda work: work.scene is not None and work.base.kind == "mesh"),
    MethodStage("", None, set_down),
    MethodStage("yielding", why_no_yielding, yielded, possible=lambda work: work.trace.force is not None),
    MethodStage("deviation", why_no_deviation, deviated, possible=lambda work: work.base.kind == "mesh"),
    MethodStage("", None, kept_over_base),
    MethodStage("", None, made_sound),
    MethodStage("", None, side_asked),
    MethodStage("", None, tip_asked),
    MethodStage("algorithms 1 and 2", why_no_contact_algorithms, None, possible=_never),
    MethodStage("detection", why_no_detection, detected),
    MethodStage("injected crests", why_no_injection, limit_measured, sized=False),
    MethodStage("faint lines", why_no_faint_lines, None),
    MethodStage("grammar", why_no_lines, assembled),
    MethodStage("", None, sought_along),
    MethodStage("", None, tip_asked_of_lines),
    MethodStage("posterior", why_no_posterior, refined_all),
    MethodStage("long chain", why_no_chain, None, sized=False),
    MethodStage("", None, believed),
    MethodStage("", None, told_over_sheet),
    MethodStage("", None, standing_told),
    MethodStage("smoothing", why_no_smoothing, None, sized=False),
    MethodStage("estimated surface", why_no_surface, surface_estimated, sized=False),
    MethodStage("curvature", why_no_curvature, curvature_taken, possible=_never, sized=False),
    MethodStage("roughness", why_no_roughness, roughness_taken, sized=False),
    MethodStage("", None, inspected),
    MethodStage("", None, modelled),
    MethodStage("standard heights", why_no_standard_heights, standard_heights_taken, sized=False),
    MethodStage("error against time", why_no_time_curve, compared_in_time, possible=_never, sized=False),
)


@algebra_in_one_thread()
def build_model(log: Log, scene: Scene | None, base: Base | None, stages: Stages) -> Analysis:
    """From samples to the annotated model.

    Args:
        log: what was recorded.
        scene: the scene that it was recorded for, or None.
        base: the given global model, or None to have it fitted.
        stages: the account of what runs and what is left out.
    """
    work = Work(log, scene, base, stages)
    for stage in METHOD:
        work.do(stage)
    return _result(work)


def _result(work: Work) -> Analysis:
    """What the stages led to, and what they cost."""
    log, scene, trace, truth, stages = work.log, work.scene, work.laid, work.truth, work.stages
    model = replace(work.model, left_out=tuple(stages.left_out), timings=dict(stages.timings))
    return Analysis(
        title=(scene.title if scene else "") or ", ".join(Path(source).name for source in log.sources),
        trace=trace,
        base=work.base,
        detections=work.detections,
        model=model,
        scene=scene,
        estimate=work.estimate,
        curvature=work.curvature,
        truth=truth,
        errors=compare(model, truth, trace.tip_radius) if work.truth_known else (),
        timings=dict(stages.timings),
        left_out=with_savings(stages.left_out, stages.timings),
        recovered=log.recovered,
        ended=_ended(log),
        stopped=stop_of(log),
        time_curve=work.time_curve,
        tip_counts=tip_counts(work.features, trace.tip_radius),
        inspected=work.inspected,
        account=work.account,
        path=work.path,
        lifted=work.lifted,
        yielding=work.yielding,
        deviation=work.deviation,
        refuted_tip=work.refuted_tip,
        side=work.side,
        sparse=work.sparse,
        judgements=work.judgements,
        roughness=work.roughness,
        standard_heights=work.standard_heights,
    )


def _ended(log: Log) -> str:
    """Why the exploration ended, "" if the log does not say."""
    data = next((event.data for event in reversed(log.events) if event.kind == "outcome"), {})
    return str(data.get("detail") or data.get("reason") or "")
