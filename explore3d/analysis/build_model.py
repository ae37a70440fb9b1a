"""build_model: the paper's method, one line a stage; each stage runs only where the recording needs it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from explore3d import __version__
from explore3d.analysis.inspected import Inspected, base_reach
from explore3d.analysis.result import Analysis, TipCount
from explore3d.analysis.savings import with_savings
from explore3d.analysis.stages import Stages
from explore3d.analysis.surface_account import SurfaceAccount
from explore3d.analysis.time_curve import time_curve
from explore3d.analysis.truth import TrueFeature, compare
from explore3d.log import Log
from explore3d.scene import AnalysisSettings
from mapping import Feature, LeftOut, Trace
from mapping.assembly import assemble, why_none_sought
from mapping.base import Base, Pose, estimate_pose, fit_base, over_base, refined
from mapping.detection import detect
from mapping.estimate.envelope import estimate_surface
from mapping.geometry.curvature import principal_curvatures
from mapping.inference import refine_all
from mapping.model import ObjectModel

if TYPE_CHECKING:
    from explore3d.scene import Scene
    from mapping.detection import Detections
    from mapping.estimate.envelope import Estimate
    from mapping.geometry.curvature import Curvature

# The report also says what a tip of this many times the radius would call finer than itself.
OTHER_TIP = 2.5
# A pose beyond what the scene allows by this factor is not believed
BELIEVED = 1.25
# Less noise than this many tip radii is rounding: nothing to smooth away
NOISE_FREE = 2e-8


def build_model(log: Log, scene: Scene | None, base: Base | None, stages: Stages) -> Analysis:
    """From samples to the annotated model.

    Args:
        log: what was recorded.
        scene: the scene that it was recorded for, or None.
        base: the given global model, or None to have it fitted.
        stages: the account of what runs and what is left out.
    """
    settings = AnalysisSettings.of(scene)
    base = _base(log.trace, base, stages)
    base = _placed(log.trace, base, scene, stages)
    trace = _over(log.trace, base, stages)
    detections = log.detections or _detect(trace, base, settings, stages)
    asked = None if scene is None else scene.survey.smallest_feature
    features = _assemble(detections, trace, base, settings, asked, stages)
    features = _believed(_refine(features, trace, base, detections, settings, stages), stages)
    estimate = _estimate(features, trace, base, detections, stages)
    curvature = _curvature(estimate, stages)
    truth = (
        tuple(TrueFeature(t.kind, t.axis, t.height, t.width, t.length or None) for t in scene.truth) if scene else ()
    )
    inspected = Inspected.of(trace, base, detections, asked)
    account = SurfaceAccount.of_log(log, base, scene)
    model = ObjectModel.attach(
        base,
        in_model_frame(features, base),
        provenance=_provenance(log, scene, settings, detections)
        | {"inspection": inspected.record()}
        | ({} if account is None else {"surface": account.record()}),
        inspected=inspected.height,
        reach=None if estimate is None else base_reach(base.surface, estimate),
    )
    curve = _time_curve(model, truth, trace, detections, stages)
    return Analysis(
        title=(scene.title if scene else "") or ", ".join(Path(source).name for source in log.sources),
        trace=trace,
        base=base,
        detections=detections,
        model=replace(model, left_out=tuple(stages.left_out), timings=dict(stages.timings)),
        scene=scene,
        estimate=estimate,
        curvature=curvature,
        truth=truth,
        errors=compare(model, truth, trace.tip_radius) if truth or (scene and scene.finger.kind == "simulated") else (),
        timings=dict(stages.timings),
        left_out=with_savings(stages.left_out, stages.timings),
        recovered=log.recovered,
        ended=_ended(log),
        time_curve=curve,
        tip_counts=_tip_counts(features, trace.tip_radius),
        inspected=inspected,
        account=account,
    )


def _base(trace: Trace, base: Base | None, stages: Stages) -> Base:
    found = None if base is None or base.kind in ("mesh", "profile") else base
    why_not = "" if base is None or found is not None else "the global model was given"
    if base is not None and not stages.needed("base fit", why_not):
        return base
    with stages.stage("base fit"):
        # a base that was found by feeling is known better by all that was felt since
        return fit_base(trace) if found is None else refined(found, trace)


def _placed(trace: Trace, base: Base, scene: Scene | None, stages: Stages) -> Base:
    """The base where the object really stands, by everything that was felt; the first sweeps told it roughly."""
    why_not = "" if scene is not None and scene.model.pose == "estimate" else "the model's pose was given"
    # without a scene nothing says how far off the object may stand; a base that was felt stands where it was felt
    possible = scene is not None and base.kind == "mesh"
    if not stages.needed("pose", why_not, possible=possible) or scene is None:
        return base

    with stages.stage("pose"):
        pose = estimate_pose(trace, base, shift=scene.model.shift, turn=scene.model.turn)
    before = base.parameters.get("pose")
    whole = pose if before is None else pose.after(Pose.read(before))
    if whole.within(BELIEVED * scene.model.shift, BELIEVED * scene.model.turn):
        return pose.moved(base)
    stages.left_out.append(LeftOut("pose", "the object would stand further off its model than the scene allows"))
    return base


def _over(trace: Trace, base: Base, stages: Stages) -> Trace:
    """The part of the trace over a base that was found by feeling: beyond its border nothing is known."""
    if base.kind in ("mesh", "profile"):
        return trace

    inside = over_base(trace, base)
    if inside.any() and not inside.all():
        beyond = int((~inside).sum())
        stages.left_out.append(LeftOut("part of the trace", f"{beyond} samples lie beyond the body's border"))
        return trace.select(inside)
    return trace


def in_model_frame(features: tuple[Feature, ...], base: Base) -> tuple[Feature, ...]:
    """The features with their axes also in the frame of the given mesh, where the object does not stand as given."""
    if "pose" not in base.parameters:
        return features

    pose = Pose.read(base.parameters["pose"])
    return tuple(
        replace(feature, extra=feature.extra | {"axis_in_model_frame": pose.back(feature.axis).tolist()})
        for feature in features
    )


def _ended(log: Log) -> str:
    """Why the exploration ended, "" if the log does not say."""
    data = next((event.data for event in reversed(log.events) if event.kind == "outcome"), {})
    return str(data.get("detail") or data.get("reason") or "")


def _detect(trace: Trace, base: Base, settings: AnalysisSettings, stages: Stages) -> Detections:
    if not trace.has_contact_data:
        stages.needed("algorithms 1 and 2", "the log holds positions alone, no contact normals", possible=False)
    with stages.stage("detection"):
        return detect(trace, base, **settings.detection)


def _assemble(
    detections: Detections, trace: Trace, base: Base, settings: AnalysisSettings, asked: float | None, stages: Stages
) -> tuple[Feature, ...]:
    if not stages.needed("grammar", "" if detections.crossings else _why_no_lines(detections, trace, base, asked)):
        return ()

    with stages.stage("grammar"):
        return assemble(detections, trace, base, false_alarms_per_metre=settings.false_alarms_per_metre)


def _why_no_lines(detections: Detections, trace: Trace, base: Base, asked: float | None) -> str:
    """Why a trace without a single crossing cannot, or need not, hold what only many sweeps together show."""
    if asked is not None and detections.detection_limit <= asked:
        return "nothing was detected, though a single sweep shows all that the scene asks for"
    why_not = why_none_sought(detections, trace, base)
    return f"nothing was detected, and lines too faint for one sweep are not sought: {why_not}" if why_not else ""


def _refine(
    features: tuple[Feature, ...],
    trace: Trace,
    base: Base,
    detections: Detections,
    settings: AnalysisSettings,
    stages: Stages,
) -> tuple[Feature, ...]:
    if not stages.needed("posterior", "" if features else "no feature was found, so no chain was run"):
        return ()

    confirm = stages.is_forced("long chain")
    with stages.stage("posterior") as share:
        refined = refine_all(
            features,
            trace,
            settings.seed,
            base=base,
            noise=detections.noise,
            tip_sd=settings.tip_sd,
            confirm=confirm,
            progress=share,
        )
    regular = sum(each.posterior is not None and each.posterior.status == "not needed" for each in refined)
    if regular:
        stages.needed("long chain", f"the posterior of {regular} of {len(refined)} is regular (k-hat below 0.5)")
    return refined


def _believed(features: tuple[Feature, ...], stages: Stages) -> tuple[Feature, ...]:
    """Without what all sweeps together hardly speak for: a false alarm that later sweeps passed by."""
    kept = tuple(f for f in features if f.evidence.likely)
    for feature in (f for f in features if f not in kept):
        x, y, z = np.round(1e3 * feature.axis[0], 2)
        reason = f"all sweeps together hardly speak for it (log odds {feature.evidence.log_odds:.1f})"
        stages.left_out.append(LeftOut(f"a {feature.kind} at ({x:g}, {y:g}, {z:g}) mm", reason))
    return kept


def _estimate(
    features: tuple[Feature, ...], trace: Trace, base: Base, detections: Detections, stages: Stages
) -> Estimate | None:
    if not stages.needed("estimated surface", "" if features else "no feature was found; the base is the estimate"):
        return None

    free = detections.noise.sd <= NOISE_FREE * trace.tip_radius
    smooth = stages.needed("smoothing", "the trace has no noise beyond rounding" if free else "")
    with stages.stage("estimated surface"):
        return estimate_surface(trace, base=base, noise=detections.noise if smooth else None)


def _curvature(estimate: Estimate | None, stages: Stages) -> Curvature | None:
    if estimate is None:
        why_not = "there is no estimated surface to take it from"
    elif estimate.surface is None:
        why_not = "a single profile has no surface: its curvature is in the crossings"
    else:
        why_not = ""
    if not stages.needed("curvature", why_not, possible=False) or estimate is None or estimate.surface is None:
        return None

    with stages.stage("curvature"):
        return principal_curvatures(estimate.surface, noise=estimate.sd)


def _time_curve(
    model: ObjectModel, truth: tuple[TrueFeature, ...], trace: Trace, detections: Detections, stages: Stages
) -> tuple[tuple[float, float], ...]:
    why_not = "" if truth and model.features else "the truth is not known, or nothing was found"
    if not stages.needed("error against time", why_not, possible=False):
        return ()

    with stages.stage("error against time") as share:
        return time_curve(detections, trace, model, truth, share)


def _tip_counts(features: tuple[Feature, ...], tip_radius: float) -> tuple[TipCount, ...]:
    finer = sum(feature.curvature_feature for feature in features)
    counts = [TipCount(tip_radius, finer, len(features) - finer)]
    crests = [feature.extra.get("trace_curvature") for feature in features]
    if features and all(crest is not None for crest in crests):
        other = OTHER_TIP * tip_radius
        finer = sum(abs(float(crest)) > 1.0 / (2.0 * other) for crest in crests if crest is not None)
        counts.append(TipCount(other, finer, len(features) - finer))
    return tuple(counts)


def _provenance(log: Log, scene: Scene | None, settings: AnalysisSettings, detections: Detections) -> dict[str, Any]:
    return {
        "software": f"explore3d {__version__}",
        "scene": scene.title if scene else None,
        "tip_radius": log.trace.tip_radius,
        "seed": settings.seed,
        "log_sha256": log.sha256,
        "samples": len(log.trace),
        "recovered": log.recovered,
        "noise": {
            "white": detections.noise.white,
            "correlated": detections.noise.correlated,
            "length": detections.noise.length,
        },
        "detection_limit": detections.detection_limit,
        "false_alarms_per_metre": settings.false_alarms_per_metre,
    }
