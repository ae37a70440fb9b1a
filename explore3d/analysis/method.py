"""Method: what each stage from the samples to the annotated model does, and why it may be left out.

The order of the stages stands in build_model.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from explore3d import UserError, __version__, count_text
from explore3d.analysis.inspected import Inspected, base_reach
from explore3d.analysis.result import TipCount
from explore3d.analysis.roughness import Roughness, roughness_of, surely_taken, why_no_roughness_of
from explore3d.analysis.stages import Stages
from explore3d.analysis.standard_heights import StandardHeight, has_sections, standard_heights
from explore3d.analysis.surface_account import SurfaceAccount, swept_share
from explore3d.analysis.time_curve import time_curve
from explore3d.analysis.truth import TrueFeature
from explore3d.log import Log, read_noise, stop_of
from explore3d.scene import AnalysisSettings, Scene
from mapping import Dropped, EnvelopeError, Feature, LeftOut, Trace, length_text, place_text
from mapping.assembly import (
    RUNS_ALONG,
    AlongSweeps,
    Inspections,
    along_sweeps,
    assemble,
    felt_alone,
    half_felt,
    inspected_for,
    why_none_sought,
    without_wide,
)
from mapping.base import Base, Form, LaidTrace, Pose, estimate_pose, fit_base, over_base, refined, sheet_moved
from mapping.detection import RAW_SAMPLES, Detections, detect, narrowest_groove, recovered
from mapping.detection.path import (
    Backlash,
    Lifted,
    PathLedger,
    SoundSweeps,
    SparseSamples,
    backlash,
    lifted,
    path_ledger,
    sound_sweeps,
    sparse_samples,
    with_doubt,
    without_backlash,
)
from mapping.estimate.deviation import (
    Deviation,
    UnclimbedLevel,
    Yielding,
    explain,
    felt_enough,
    left_standing,
    unclimbed_levels,
    yielding,
)
from mapping.estimate.envelope import (
    RefutedTip,
    WrongSide,
    estimate_surface,
    refuted_by_lines,
    refuted_tip,
    wrong_side,
)
from mapping.geometry.curvature import principal_curvatures
from mapping.geometry.mesh import distances
from mapping.inference.joint import refine_all
from mapping.inference.kinds import kind_of, sizes_of
from mapping.model import Judgement, ObjectModel, Tolerance, dropped_crossings, dropped_features, judged

if TYPE_CHECKING:
    from mapping.estimate.envelope import Estimate
    from mapping.geometry.curvature import Curvature

# The report also says what a tip of this many times the radius would call finer than itself.
OTHER_TIP = 2.5
# A pose beyond what the scene allows by this factor is not believed
BELIEVED = 1.25
# Less noise than this many tip radii is rounding: nothing to smooth away
NOISE_FREE = 2e-8

# What is left out where what may be a feature is none: taken for form, or too wide
ABSORBED, PART, DEVIATION_MAP, YIELDING = "part of the form", "part of the trace", "deviation map", "yielding"
# What is said of a model that nothing speaks against because nothing could
TOO_LITTLE_FELT = "too little was felt to hold the model against it: a wrong one would not be named"
# What a stage could not do although it was needed
FAILED = "could not be done"
# Why what is fainter than single sweeps show is not sought
SHOWS_ALL = "a single sweep shows all that the scene asks for"
_NO_BASE = (
    "lies on the base that was found for it: what is a detail and what is the body is a guess there, and neither sizes "
    "nor the limit are to be relied on; --form and --mask say what the base is"
)
_TOO_WIDE = "stands off the base and is wider than fine features are: only its edges are sought"
# Of these so many are described one by one
MOST_STANDING = 5

# Why a stage that does not tell existence, places and sizes was left out
NOT_IN_QUICK = "quick results were asked for: existence, places and sizes"

# Bases that have an inside
WITH_INSIDE = ("sphere", "cylinder", "tube", "star body")

# Rounds in which crests and the play of the axes settle: the first finds crests that the play has moved. A simulated
# play as large as the noise is found to 0.86 of it by the first and to 0.97 by the last, two to four in all; one twice
# as large to 1.0 at once.
PLAY_ROUNDS = 5

# Most doubt of the tip that an offset makes, in radii. What stands off by more is a frame; and a tip that is said 10 %
# too large lies two of these off
MOST_TIP_DOUBT = 0.05

# Told the share of a stage that is done, 0 to 1
Share = Callable[[float], None]


@dataclass(frozen=True)
class MethodStage:
    """One stage of the method.

    Args:
        name: in the account of timings and of what was left out; "" for what is too short to be timed.
        why_not: one sentence saying why the stage is not needed, "" if it is, None if the question does not arise;
            no function at all: it always runs.
        run: does the stage's work; None for a part of another stage.
        possible: False where there is nothing to work on: then the stage is left out even if forced.
        sized: False if existence, places and sizes do without it: quick results leave it out.
    """

    name: str
    why_not: Callable[[Work], str | None] | None
    run: Callable[[Work, Share], None] | None
    possible: Callable[[Work], bool] = lambda work: True
    sized: bool = True


@dataclass
class Work:
    """What is given, and what the stages have found so far.

    Args:
        log: what was recorded.
        scene: the scene that it was recorded for, or None.
        given: the global model as it was given, or None.
        stages: the account of what runs and what is left out.
        trace: the samples that count; on the base once that is known.
        base: the global model.
        detections: crossings, noise, detection limit.
        features: as they are known by now.
        dropped: what was detected and is no feature.
        along: lines that run along the sweeps, and what they are fitted to; None if there are none.
        inspections: the heights of the trace that the features were assembled from.
        sound: the trace under sound sweep numbers; None for a log that was searched while it was read.
        path: what became of the recorded path.
        lifted: what of the recording is no contact, and was left out; None if nothing is known to be.
        yielding: what the finger yields by, put back; None if nothing is known of it.
        deviation: what the given model gets wrong; None if nothing is known to be.
        judgements: what became of the tolerances.
        apart: samples left out for that.
        refuted_tip: what the trace says against the radius of the tip; None if nothing.
        side: what the trace says against the side of the path that the body was taken to lie on; None if nothing.
        sparse: what lies unfelt between samples that are further apart than the ball is wide; None if they are not.
        roughness: what the surface is like beside the features.
        standard_heights: what its ridges, grooves and steps measure by the standards.
        backlash: the play of the machine's axes, taken off; None if nothing speaks for one.
        before: trace and base (None: still to be fitted) before anything was taken off, and how much was left out then.
        asked: whether a stage was asked for, by its name.
    """

    log: Log
    scene: Scene | None
    given: Base | None
    stages: Stages
    trace: Trace = field(init=False)
    base: Base = field(init=False)
    laid: LaidTrace = field(init=False)
    detections: Detections = field(init=False)
    model: ObjectModel = field(init=False)
    inspected: Inspected = field(init=False)
    features: tuple[Feature, ...] = ()
    dropped: tuple[Dropped, ...] = ()
    estimate: Estimate | None = None
    curvature: Curvature | None = None
    account: SurfaceAccount | None = None
    judgements: tuple[Judgement, ...] = ()
    along: AlongSweeps | None = None
    inspections: Inspections | None = None
    sound: SoundSweeps | None = None
    path: PathLedger | None = None
    lifted: Lifted | None = None
    yielding: Yielding | None = None
    deviation: Deviation | None = None
    apart: int = 0
    refuted_tip: RefutedTip | None = None
    side: WrongSide | None = None
    sparse: SparseSamples | None = None
    roughness: Roughness | None = None
    standard_heights: tuple[StandardHeight, ...] = ()
    time_curve: tuple[tuple[float, float], ...] = ()
    backlash: Backlash | None = None
    before: tuple[Trace, Base | None, int] | None = None
    asked: dict[str, bool] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.trace = self.log.trace
        settings = AnalysisSettings.of(self.scene, read_noise(self.log.events))
        self.settings = settings.of_means(self.log.metadata.get("average"))
        if self.log.tip_sd is not None:
            self.settings = replace(self.settings, tip_sd=self.log.tip_sd)
        if self.given is not None:
            self.base = self.given

    @property
    def tip_sd(self) -> float:
        """Standard deviation of the tip's radius, m: an offset of the base that was taken off may be the ball's."""
        told = self.settings.tip_sd
        return max(told, min(float(np.hypot(told, self.base.offset)), MOST_TIP_DOUBT * self.trace.tip_radius))

    @property
    def tolerances(self) -> tuple[Tolerance, ...]:
        """What the drawing allows: as the analysis was told, else as the scene says."""
        if self.log.tolerances is not None:
            return self.log.tolerances
        return () if self.scene is None else self.scene.tolerances

    @property
    def truth(self) -> tuple[TrueFeature, ...]:
        """True features that the scene states."""
        true = self.scene.truth if self.scene else ()
        return tuple(TrueFeature(t.kind, t.axis, t.height, t.width, t.length or None) for t in true)

    @property
    def truth_known(self) -> bool:
        """True if the scene states true features, or its simulated finger touches the very model: nothing is on it."""
        scene = self.scene
        if scene is None or scene.finger.is_real:
            return bool(self.truth)
        return bool(self.truth) or scene.finger.touched == (scene.model.mesh, scene.model.units)

    @property
    def smallest_feature(self) -> float | None:
        """Height of the smallest feature that the scene asks for, m, or None."""
        return None if self.scene is None else self.scene.smallest

    @property
    def shows_all_asked(self) -> bool:
        """True if a single sweep shows features as low as the scene asks for."""
        return self.smallest_feature is not None and self.detections.detection_limit <= self.smallest_feature

    def wants(self, name: str) -> bool:
        """True if the part of a stage with this name was asked for."""
        return self.asked.get(name, False)

    def do(self, stage: MethodStage) -> None:
        """Ask whether a stage is needed, and run and time it or note why not."""
        if stage.why_not is not None:
            reason = stage.why_not(self)
            if reason == "" and self.stages.quick and not stage.sized:
                reason = NOT_IN_QUICK
            self.asked[stage.name] = reason is not None and self.stages.needed(
                stage.name, reason, possible=stage.possible(self)
            )
            if not self.asked[stage.name]:
                return
        if stage.run is None:
            return
        if not stage.name:
            stage.run(self, lambda share: None)
            return
        with self.stages.stage(stage.name) as share:
            stage.run(self, share)


def why_no_fit(work: Work) -> str:
    """A base that was found by feeling is fitted again, a given one is not."""
    if work.given is not None and work.log.form != Form():
        raise UserError("form and mask say how a base is fitted, but the global model of this log is given")
    return "" if work.given is None or _was_found(work.given) else "the global model was given"


def fitted(work: Work, share: Share) -> None:
    """The base; one that was found by feeling is known better by all that was felt since."""
    _keep_aside(work, work.given)
    again = work.given is not None and _was_found(work.given)
    work.base = refined(work.base, work.trace) if again else fit_base(work.trace, form=work.log.form)
    on = work.base.parameters.get("on_base")
    if isinstance(on, float) and on < 0.5:
        work.stages.left_out.append(LeftOut(ABSORBED, f"only {100 * on:.0f} % of the profile {_NO_BASE}"))
    for bend in _bends(work.base, "absorbed"):
        end = "was taken for the base's own form; if it is a feature, say --form line, arc or poly:2, or --mask it"
        work.stages.left_out.append(LeftOut(ABSORBED, f"{_described(bend)} {end}"))
    for slope in _bends(work.base, "slopes"):
        end = "wider than fine features are: it is taken for the base's own form, and no step is told"
        work.stages.left_out.append(LeftOut(ABSORBED, f"{_climb_text(slope)}, {end}"))


def _bends(base: Base, name: str) -> list[dict[str, Any]]:
    """What stands alone in the profile that the base was fitted to, and was dealt with in this way."""
    found = base.parameters.get(name, [])
    return [bend for bend in found if isinstance(bend, dict)] if isinstance(found, list) else []


def _described(bend: dict[str, Any]) -> str:
    """What stands alone in a profile: depth, width, place."""
    kind, sense = ("hollow", "deep") if bend["height"] < 0 else ("hump", "high")
    height, width = length_text(abs(bend["height"]), 2), length_text(bend["width"], 2)
    return f"a {kind} {height} {sense} and {width} wide at {_place_of(bend)}"


def _climb_text(climb: dict[str, Any]) -> str:
    way, height = "rises" if climb["height"] > 0.0 else "falls", length_text(abs(climb["height"]), 2)
    over = f"{length_text(climb['width'], 2)} at {_place_of(climb)}"
    return f"from one level to another the profile {way} by {height} over {over}"


def _place_of(bend: dict[str, Any]) -> str:
    return f"({', '.join(f'{1e3 * value:.4g}' for value in bend['place'])}) mm"


def _open_end_text(end: dict[str, Any]) -> str:
    length = length_text(float(np.linalg.norm(np.subtract(end["to"], end["from"]))), 2)
    place = ", ".join(f"{1e3 * value:.4g}" for value in end["from"])
    way = "below" if end["height"] < 0 else "above"
    return (
        f"from ({place}) mm to its end, {length}, the profile stands off its base for good, up to "
        f"{length_text(abs(end['height']), 2)} {way} it: a detail that the end cuts, or the body's own edge; nothing "
        "is told of it"
    )


def _was_found(base: Base) -> bool:
    return base.kind not in ("mesh", "profile")


def why_no_pose(work: Work) -> str:
    """Without a scene nothing says how far off the object may stand; a base that was felt stands where it was felt."""
    estimated = work.scene is not None and work.scene.model.pose == "estimate"
    if estimated:
        return ""
    return "the model's pose was given" if work.given is not None else "the base stands where it was felt"


def placed(work: Work, share: Share) -> None:
    """The base where the object really stands, by everything that was felt; the first sweeps told it roughly."""
    if work.scene is None:
        return
    allowed = work.scene.model
    pose = estimate_pose(work.trace, work.base, shift=allowed.shift, turn=allowed.turn)
    before = Pose.of(work.base)
    whole = pose if before is None else pose.after(before)
    if whole.within(BELIEVED * allowed.shift, BELIEVED * allowed.turn):
        work.base = pose.moved(work.base)
        return
    reason = "the object would stand further off its model than the scene allows"
    work.stages.left_out.append(LeftOut("pose", reason))


def set_down(work: Work, share: Share) -> None:
    """The trace without what a recording that nobody vouches for holds of the way through the air."""
    if work.log.in_contact or work.log.detections:
        return
    work.trace = LaidTrace.of(work.trace, work.base)
    side_known = work.given is not None or work.trace.has_contact_data
    work.lifted = lifted(work.trace, side_known)
    if work.lifted is None:
        return
    _go_on_with(work, work.trace.select(work.lifted.felt), share)
    if work.wants("pose"):
        placed(work, share)
    if work.lifted.inwards:
        work.side = WrongSide(0, 0, 0.0, lifts=work.lifted.pieces)


def _go_on_with(work: Work, trace: Trace, share: Share) -> None:
    """Another trace of the same recording; a base that was fitted is fitted to it."""
    work.trace = trace
    if work.before is not None:
        _, base, mark = work.before
        work.before = trace, base, mark
        said = work.stages.left_out
        said[mark:] = [each for each in said[mark:] if each.stage != ABSORBED]
    if work.given is None or _was_found(work.given):
        fitted(work, share)


def why_no_yielding(work: Work) -> str | None:
    """Only where forces were recorded can it be told what a finger yields by."""
    return None if work.log.detections or work.trace.force is None else ""


def yielded(work: Work, share: Share) -> None:
    """The trace where the tip was, by what pressed on it; a base that was fitted is fitted to that."""
    work.trace = LaidTrace.of(work.trace, work.base)
    work.yielding = yielding(work.trace)
    if work.yielding is None:
        work.stages.left_out.append(LeftOut(YIELDING, "the heights do not follow the recorded forces"))
        return
    _go_on_with(work, work.yielding.without(work.trace), share)


def why_no_deviation(work: Work) -> str | None:
    """Only a model that was given can be wrong: one that was fitted is what was felt."""
    if work.log.detections:
        return None
    return "" if work.base.kind == "mesh" else "the base was fitted to what was felt"


def deviated(work: Work, share: Share) -> None:
    """The model corrected where what was felt shows it to be wrong at long wavelengths; parts apart are left out."""
    _keep_aside(work, work.base)
    laid = LaidTrace.of(work.trace, work.base)
    if len(laid) <= RAW_SAMPLES or _all_are_asked_for(work):
        laid.feet()  # detection asks for all of so few, roughness in any case: the blocks here follow from them
    swept = [event.data for event in work.log.events if event.kind == "move" and event.data["purpose"] == "sweep"]
    work.deviation = explain(laid, work.base, [np.asarray(data["path"], dtype=np.float64) for data in swept])
    if work.deviation is None:
        agrees = LeftOut(DEVIATION_MAP, "what was felt agrees with the model at long wavelengths")
        work.stages.left_out.append(agrees if felt_enough(laid, work.base) else LeftOut(FAILED, TOO_LITTLE_FELT))
        work.trace = laid
        return
    work.base = work.deviation.base
    laid = LaidTrace.of(work.trace, work.base)
    laid = LaidTrace.of(work.deviation.without_drift(laid), work.base)
    if work.deviation.parts and not work.deviation.beyond_repair:
        keep = work.deviation.outside(laid.feet().points)
        work.apart = int((~keep).sum())
        laid = laid.within(keep)
        for part in work.deviation.parts:
            path = f"{length_text(part.path, 2)} of path over it were not looked at"
            work.stages.left_out.append(LeftOut(PART, f"{part.sentence()}; {path}"))
    work.trace = laid


def kept_over_base(work: Work, share: Share) -> None:
    """The trace on its base, without the part beyond the border of one found by feeling: there nothing is known.

    Nor is there where a profile leaves its base for good: neither of the detail that its end cuts, nor of an edge.
    """
    work.laid = LaidTrace.of(work.trace, work.base)
    ends = _bends(work.base, "open_ends")
    if ends:
        inside = ~np.any(
            [(work.trace.centers - end["from"]) @ np.subtract(end["to"], end["from"]) > 0 for end in ends], 0
        )
        work.laid, work.trace = work.laid.within(inside), work.trace.select(inside)
        work.stages.left_out += [LeftOut(ABSORBED, _open_end_text(end)) for end in ends]
    if _was_found(work.base):
        inside = over_base(work.laid, work.base)
        if inside.any() and not inside.all():
            beyond = f"{int((~inside).sum())} samples lie beyond the body's border"
            work.stages.left_out.append(LeftOut(PART, beyond))
            work.laid = work.laid.within(inside)
            work.trace = work.trace.select(inside)
    if _all_are_asked_for(work):
        work.laid.feet()  # blocks and bins follow from them


def _all_are_asked_for(work: Work) -> bool:
    """True if the parameters of roughness are going to be taken, of every sample."""
    asked = not work.log.detections and not work.stages.quick
    return asked and surely_taken(work.trace, work.stages.cutoffs[0])


def made_sound(work: Work, share: Share) -> None:
    """Sweeps that turn under one number, cut; what was searched while it was read has been thinned out."""
    if work.log.detections:
        return
    work.sound = sound_sweeps(work.laid, work.base)
    if work.sound.cuts:
        work.laid = work.trace = work.sound.trace


def side_asked(work: Work, share: Share) -> None:
    """The side of the path that the body lies on, held against the trace's kinks; where it is a round body's wrong one,
    the base is turned over: positions alone do not tell a bore from a shaft."""
    alone = work.given is None and not work.trace.has_contact_data
    if work.side is None and alone and not work.log.detections:
        work.side = wrong_side(work.laid)
    if work.side is not None and work.base.kind in WITH_INSIDE:
        hollow = bool(work.base.parameters.get("hollow", False))
        work.base = fit_base(work.trace, form=work.log.form, inside=not hollow)
        work.side = replace(work.side, turned=True)
        kept_over_base(work, share)
        made_sound(work, share)


def tip_asked(work: Work, share: Share) -> None:
    """The radius of the tip, held against the trace while all of it is there (a tip told too large takes what it feels
    for outliers), and against the distance of the samples."""
    if not work.log.detections:
        work.refuted_tip = refuted_tip(work.laid, work.settings.tip_sd)
        # of means the path between was felt, by the samples that they are the means of
        work.sparse = None if work.log.metadata.get("average") else sparse_samples(work.laid)


def why_no_contact_algorithms(work: Work) -> str | None:
    """Algorithms 1 and 2 of the paper are a part of the detection."""
    if work.log.detections:
        return None
    return "" if work.trace.has_contact_data else "the log holds positions alone, no contact normals"


def why_no_detection(work: Work) -> str | None:
    """A log that was detected in while it was read brings its detections along."""
    if not work.log.detections:
        return ""
    work.detections = work.log.detections
    return None


def _keep_aside(work: Work, base: Base | None) -> None:
    """Remember what the stages from here on began with."""
    if work.before is None:
        work.before = work.trace, base, len(work.stages.left_out)


def detected(work: Work, share: Share) -> None:
    """Crossings of single sweeps, of readings that hang behind no more.

    Crests that the play has moved tell less of it than those that it is taken off from, so it is, on trial; one that
    remains in doubt is put back.
    """
    _searched(work)
    if work.before is None or not _may_hang_behind(work):
        return
    untouched, said = vars(work).copy(), work.stages.left_out.copy()
    for _ in range(PLAY_ROUNDS):
        taken = work.backlash
        work.backlash = backlash(work.laid, without_wide(work.detections, work.laid), taken)
        if work.backlash is None:
            break
        if taken is not None and abs(work.backlash.play - taken.play) < 0.5 * work.backlash.sd:
            work.backlash = replace(work.backlash, play=taken.play, lag=taken.lag)
            break
        _begun_again(work, without_backlash(work.before[0], work.backlash), share)
    if work.backlash is None or not work.backlash.told:
        vars(work).update(untouched | {"backlash": work.backlash})
        work.stages.left_out[:] = said
    if work.backlash is not None:
        work.detections = with_doubt(work.detections, work.backlash)


def _may_hang_behind(work: Work) -> bool:
    """True if heights can tell: over a base that is known, noise and all, in the order of time. One profile cannot tell
    roughness from small features, and so not which side of them is steeper, either."""
    refused = work.deviation is not None and work.deviation.beyond_repair
    noisy = work.detections.noise.sd > NOISE_FREE * work.trace.tip_radius
    in_time = bool((np.diff(work.log.trace.t) >= 0.0).all())
    return noisy and in_time and not refused and work.base.kind != "profile"


def _begun_again(work: Work, trace: Trace, share: Share) -> None:
    """The stages up to the crossings, of another trace of the same recording."""
    assert work.before is not None
    _, base, mark = work.before
    said = work.stages.left_out
    said[mark:] = [each for each in said[mark:] if each.stage not in (ABSORBED, FAILED, PART, DEVIATION_MAP)]
    work.trace, work.apart = trace, 0
    if base is None:
        fitted(work, share)
    else:
        work.base = base
    if work.wants("deviation"):
        deviated(work, share)
    kept_over_base(work, share)
    made_sound(work, share)
    _searched(work)


def _searched(work: Work) -> None:
    """Crossings of single sweeps; samples that cannot have been felt count no more for anything that follows."""
    in_air = 0 if work.lifted is None else int((~work.lifted.felt).sum())
    beyond = len(work.log.trace) - in_air - len(work.laid) - work.apart
    work.detections = detect(work.laid, work.base, **work.settings.detection)
    keep = np.ones(len(work.trace), dtype=bool)
    if work.detections.unfelt:
        keep[list(work.detections.unfelt)] = False
        work.trace, work.laid = work.trace.select(keep), work.laid.within(keep)
        found = detect(work.laid, work.base, **work.settings.detection)
        work.detections = replace(found, left_out=(*work.detections.left_out, *found.left_out))
    refused = work.deviation is not None and work.deviation.beyond_repair
    if work.sound is not None:
        work.path = path_ledger(work.sound, work.detections, beyond, work.apart, refused, keep)
    if work.deviation is not None and refused:
        crossings = len(work.detections.crossings)
        said = f"the model is wrong: of {crossings} places that stand off it, none is called a feature"
        said += f"; what is needed is {work.deviation.needs()}"
        # nothing was looked for, so nothing would have been seen
        work.detections = replace(
            work.detections,
            crossings=(),
            detection_limit=np.inf,
            inspected_length=0.0,
            inspected_sweeps=(),
            left_out=(*work.detections.left_out, said),
        )


def why_no_injection(work: Work) -> str:
    """Where the noise is as the fitted law says, the computed limit is the measured one, to within a few per cent."""
    if work.deviation is not None and work.deviation.beyond_repair:
        return "the model is shown to be wrong beyond repair"
    if work.log.detections:
        return "the log was detected in while it was read"
    return "" if work.detections.limit_in_doubt else "the noise is as the fitted law says"


def limit_measured(work: Work, share: Share) -> None:
    """The detection limit, by crests that are put into the log's own quiet path."""
    rng = np.random.default_rng(work.settings.seed)
    work.detections = recovered(work.detections, work.laid, rng, share, **work.settings.detection)


def why_no_lines(work: Work) -> str:
    """Why a trace without a single crossing cannot, or need not, hold what only many sweeps together show."""
    if work.deviation is not None and work.deviation.beyond_repair:
        return "the model is shown to be wrong beyond repair"
    if work.detections.crossings:
        return ""
    if work.shows_all_asked:
        return f"nothing was detected, though {SHOWS_ALL}"
    why_not = why_none_sought(work.detections, work.trace, work.base)
    return f"nothing was detected, and lines too faint for one sweep are not sought: {why_not}" if why_not else ""


def why_no_faint_lines(work: Work) -> str | None:
    """Lines too low for any one sweep are sought where the scene asks for what is so low; a part of the grammar."""
    if why_no_lines(work) and not work.stages.is_forced("grammar"):
        return None
    return SHOWS_ALL if work.shows_all_asked else ""


def assembled(work: Work, share: Share) -> None:
    """Features from the crossings, and lines that no single sweep shows."""
    rate, found, faint = work.settings.false_alarms_per_metre, work.detections, work.wants("faint lines")
    work.inspections = inspected_for(found, work.laid, work.base, faint=faint)
    work.features = assemble(
        found, work.laid, work.base, false_alarms_per_metre=rate, faint=faint, inspections=work.inspections
    )


def sought_along(work: Work, share: Share) -> None:
    """Lines that run along the sweeps of a raster, which none of them crosses; a given model takes what is off of each
    sweep for drift, and a log that was searched while it was read has been thinned out."""
    if work.base.kind not in ("mesh", "profile") and not work.log.detections:
        rate = work.settings.false_alarms_per_metre
        work.along = along_sweeps(work.laid, work.detections, rate)


def tip_asked_of_lines(work: Work, share: Share) -> None:
    """The radius of the tip, held against all crossings of a ridge together: noise hides little of so many."""
    if work.sound is not None and work.refuted_tip is None:
        kinds = [(kind_of(feature), feature) for feature in work.features]
        ridges = [feature for kind, feature in kinds if kind.line and kind.sign > 0 and kind.sampled]
        work.refuted_tip = refuted_by_lines(work.sound.trace, ridges, work.detections.noise, work.settings.tip_sd)


def why_no_posterior(work: Work) -> str:
    """Nothing found needs none."""
    return "" if work.features or work.along is not None else "no feature was found, so no chain was run"


def refined_all(work: Work, share: Share) -> None:
    """The posterior of every feature."""
    work.features = refine_all(
        work.features,
        work.laid,
        work.settings.seed,
        base=work.base,
        noise=work.detections.noise,
        tip_sd=work.tip_sd,
        confirm=work.stages.is_forced("long chain") or (None if work.stages.quick else False),
        progress=share,
    )
    if work.along is not None:
        beside = refine_all(
            work.along.features,
            work.along.trace,
            work.settings.seed,
            base=work.base,
            noise=work.along.noise,
            tip_sd=work.tip_sd,
            confirm=None if work.stages.quick else False,
        )
        work.features = (*work.features, *beside)


def why_no_chain(work: Work) -> str | None:
    """Importance sampling says by k-hat where it can be trusted; the chain is a part of the posterior."""
    if not work.wants("posterior"):
        return None
    regular = sum(each.posterior is not None and each.posterior.status == "not needed" for each in work.features)
    of_all = f"{regular} of {len(work.features)}"
    return f"the posterior of {of_all} is regular (k-hat below 0.5)" if regular else ""


def believed(work: Work, share: Share) -> None:
    """Without what all sweeps together hardly speak for: a false alarm that later sweeps passed by."""
    told = [feature for feature in work.features if feature.evidence.likely]
    alone = _felt_alone(work, told)
    unlikely = dropped_features(
        [
            feature
            for feature in work.features
            if not feature.evidence.likely
            and not any(distances(feature.axis, each.axis).min() < 0.5 * each.width.high for each in alone)
        ]
    )
    work.features = (*work.features, *alone)
    cut = () if work.inspections is None else half_felt(work.detections, work.laid, work.inspections)
    lone = dropped_crossings(work.detections.crossings, work.features, work.trace.tip_radius, cut)
    work.dropped = (*unlikely, *lone)
    for each in unlikely:
        at = place_text(each.point, work.trace.tip_radius)
        work.stages.left_out.append(LeftOut(f"a {each.kind} at {at}", each.reason))
    # what is said of a neighbourhood counts what was just dropped
    gone = {feature.details.account for feature in work.features if not feature.evidence.likely} - {None}
    work.features = tuple(
        replace(feature, details=replace(feature.details, account=None)) if feature.details.account in gone else feature
        for feature in work.features
        if feature.evidence.likely
    )
    if work.backlash is not None:
        tip = work.trace.tip_radius
        work.features = tuple(_doubted(feature, work.backlash, tip) for feature in work.features)
    if work.yielding is not None:
        work.features = tuple(_pressed(feature, work.yielding, work.laid) for feature in work.features)


def told_over_sheet(work: Work, share: Share) -> None:
    """The features with what a sheet took of them that was fitted through them and bends as tightly."""
    pieces = work.base.parameters.get("pieces")
    if isinstance(pieces, list) and not work.log.detections:
        counts = [round(each) for each in pieces if isinstance(each, float)]
        work.features = tuple(_over_sheet(feature, counts, work) for feature in work.features)


def _over_sheet(feature: Feature, pieces: Sequence[int], work: Work) -> Feature:
    tip, height = work.trace.tip_radius, feature.height
    if kind_of(feature).sided:
        return feature
    width = max(2.0 * sizes_of(feature, tip).half_width, feature.width.high)
    rise = sheet_moved(work.trace, pieces, feature.axis, width)
    if 2.0 * abs(rise) < height.high - height.low:
        return feature
    lies = f"{length_text(abs(rise), 2)} {'higher' if rise > 0.0 else 'lower'}"
    note = (
        f"the base bends as tightly as this {feature.kind} and was fitted through it: without what was felt of it the "
        f"base lies {lies}; its height is told over that, and in doubt by as much"
    )
    work.stages.left_out.append(LeftOut(ABSORBED, f"at {place_text(feature.axis.mean(axis=0), tip)} {note}"))
    over = replace(height, median=height.median - rise, low=height.low - rise, high=height.high - rise)
    return replace(feature, height=over.with_doubt(abs(rise)), notes=(*feature.notes, note))


def _felt_alone(work: Work, told: Sequence[Feature]) -> list[Feature]:
    """What single sweeps show beside what is told; over a given base that may be off, or by a log that has been thinned
    out, they tell nothing of it, and each sweep of a profile has told its sections already."""
    if not work.detections.crossings or work.log.detections or work.base.kind in ("mesh", "profile"):
        return []
    return felt_alone(work.detections, work.laid, told)


def _pressed(feature: Feature, finger: Yielding, trace: Trace) -> Feature:
    """The feature with what its height may be off by where the finger pressed otherwise on it than on the ground."""
    sd = finger.height_sd(trace, feature.axis, feature.height.median)
    return replace(feature, height=feature.height.with_doubt(sd))


def _doubted(feature: Feature, play: Backlash, tip_radius: float) -> Feature:
    """The feature with what the play leaves in doubt of its place and its height."""
    height, sd = abs(feature.height.median), feature.details.axis_sd
    aside = play.aside(height, float(np.sqrt(2.0 * tip_radius * height)))
    details = feature.details if sd is None else replace(feature.details, axis_sd=np.hypot(sd, aside))
    doubted = feature.height.with_doubt(play.height_sd)
    return replace(feature, height=doubted, details=details, position_sd=float(np.hypot(feature.position_sd, aside)))


def standing_told(work: Work, share: Share) -> None:
    """What stands off a fitted base and no feature accounts for; a given model is judged by the deviation."""
    if work.base.kind == "profile":
        found = _bends(work.base, "left standing")
    else:
        felt = work.base.kind != "mesh" and not work.log.detections
        found = [asdict(each) for each in left_standing(work.laid)] if felt else []
    found = [bend for bend in found if not any(_accounts_for(each, bend) for each in work.features)]
    beside = list[Feature]()
    for feature in work.features:
        for note in (note for note in feature.notes if note.startswith(RUNS_ALONG)):
            at = place_text(feature.axis.mean(axis=0), work.trace.tip_radius)
            work.stages.left_out.append(LeftOut(ABSORBED, f"the {feature.kind} at {at} {note}"))
            beside.append(feature)
    for level in unclimbed_levels(work.laid):
        told = any(_stands_between(each, level, work.trace.tip_radius) for each in work.features)
        if not told and not any(_climbs_at(each, level, work.trace.tip_radius) for each in beside):
            work.stages.left_out.append(LeftOut(ABSORBED, _unclimbed_text(level)))
    steps = [feature.axis for feature in work.features if kind_of(feature).sided]
    for climb in _bends(work.base, "climbs"):
        reach = 0.5 * climb["width"] + work.trace.tip_radius  # centres stand a radius above the body
        if not any(distances(np.array([climb["place"]]), axis)[0] < reach for axis in steps):
            end = "and no step accounts for it: its levels may be no levels, and what is told there is a guess"
            work.stages.left_out.append(LeftOut(ABSORBED, f"{_climb_text(climb)}, {end}"))
    for bend in found[:MOST_STANDING]:
        seen = f" in {count_text(bend['sweeps'], 'sweep')}" if "sweeps" in bend else ""
        work.stages.left_out.append(LeftOut(ABSORBED, f"{_described(bend)}{seen} {_TOO_WIDE}"))
    if len(found) > MOST_STANDING:
        more = count_text(len(found) - MOST_STANDING, "wide hollow or hump stands", "wide hollows and humps stand")
        work.stages.left_out.append(LeftOut(ABSORBED, f"besides, {more} off the base"))


def _unclimbed_text(level: UnclimbedLevel) -> str:
    side = "above" if level.height > 0.0 else "below"
    return (
        f"from sweep {level.behind} on the surface stands {length_text(abs(level.height), 2)} {side} that of sweep "
        f"{level.before}, and no sweep climbs between them: a step along the sweeps, or the instrument's own; sweeps "
        "across would tell, and none is counted as a feature"
    )


def _stands_between(feature: Feature, level: UnclimbedLevel, tip_radius: float) -> bool:
    """True of a step between the two sweeps, about as high as their levels are apart: sweeps across have found it."""
    as_high = 0.5 < abs(feature.height.median / level.height) < 2.0
    # the sweeps' centres are a radius above the body
    near = float(distances(level.place[None], feature.axis)[0]) < level.apart + 2.0 * tip_radius
    return kind_of(feature).sided and as_high and near


def _climbs_at(feature: Feature, level: UnclimbedLevel, tip_radius: float) -> bool:
    """True of a line along the sweeps if one of its walls stands between the two sweeps."""
    rolled = float(np.sqrt(2.0 * tip_radius * abs(feature.height.median)))
    feet = level.place[None] - tip_radius * feature.normals[:1]
    return bool(distances(feet, feature.axis)[0] < 0.5 * feature.width.high + rolled + level.apart)


def _accounts_for(feature: Feature, bend: dict[str, Any]) -> bool:
    """True if a feature overlaps with what stands off the base, on the same side and as high."""
    bounds = np.array([feature.height.low, feature.height.high])
    if kind_of(feature).sided:  # a base drawn through a step swings about it
        bounds = np.append(bounds, -bounds)
    as_high = max(np.sign(bend["height"]) * bounds) >= abs(bend["height"])
    apart = float(distances(np.asarray(bend["place"])[None], feature.axis)[0])
    return bool(as_high and apart <= 0.5 * (feature.width.high + bend["width"]))


def why_no_smoothing(work: Work) -> str | None:
    """Noise is smoothed away before the surface is estimated; it is a part of that stage."""
    if why_no_surface(work) and not work.stages.is_forced("estimated surface"):
        return None
    free = work.detections.noise.sd <= NOISE_FREE * work.trace.tip_radius
    return "the trace has no noise beyond rounding" if free else ""


def why_no_surface(work: Work) -> str:
    """Where nothing was found the base is the surface."""
    return "" if work.features else "no feature was found; the base is the estimate"


def surface_estimated(work: Work, share: Share) -> None:
    """The body's surface under the path of the ball's centre."""
    noise = work.detections.noise if work.wants("smoothing") else None
    try:
        work.estimate = estimate_surface(work.laid, base=work.base, noise=noise)
    except EnvelopeError as error:  # sweeps that contradict each other cost the surface, not the features
        work.stages.left_out.append(LeftOut(FAILED, f"there is no estimated surface: {error}"))


def why_no_curvature(work: Work) -> str:
    """Curvatures are those of the estimated surface."""
    if work.estimate is None:
        return "there is no estimated surface to take it from"
    return "" if work.estimate.surface else "a single profile has no surface: its curvature is in the crossings"


def curvature_taken(work: Work, share: Share) -> None:
    """Principal curvatures at the vertices of the estimated surface."""
    found = work.estimate
    if found is not None and found.surface is not None:
        # outward is where the balls touched from: the mesh alone turns inward where it ends, over a mug's mouth
        work.curvature = principal_curvatures(found.surface, normals=found.normals, noise=found.sd)
        for remark in work.curvature.remarks:
            work.stages.left_out.append(LeftOut("curvature by libigl", remark))


def why_no_roughness(work: Work) -> str | None:
    """Only a trace that is all there, long enough and felt by a fine tip tells of it."""
    return None if work.log.detections else why_no_roughness_of(work.laid, work.stages.cutoffs[0])


def roughness_taken(work: Work, share: Share) -> None:
    """The standards' parameters of what is left beside the features."""
    work.roughness = roughness_of(work.laid, work.features, work.detections.noise.sd, *work.stages.cutoffs)


def inspected(work: Work, share: Share) -> None:
    """Which places are free of features, and above which height."""
    asked = {} if work.scene is None else work.scene.model.asked
    # over a model that is refused nothing was looked for on any sweep, which is said otherwise
    refused = work.deviation is not None and work.deviation.beyond_repair
    told = not refused and not work.log.detections
    seen = {number for number, length in work.detections.inspected_sweeps if length > 0.0} if told else None
    work.inspected = Inspected.of(work.laid, work.base, work.detections, work.smallest_feature, **asked, seen=seen)
    work.account = SurfaceAccount.of_log(work.log, work.laid, work.base, work.scene, work.inspected, seen)
    work.inspected = work.inspected.counted()


def modelled(work: Work, share: Share) -> None:
    """The features anchored on the base."""
    surface = {} if work.account is None else {"surface": work.account.record()}
    path = {} if work.path is None else {"path": work.path.record()}
    rough = {} if work.roughness is None else {"roughness": work.roughness.record()}
    deviation = {} if work.deviation is None else {"deviation": work.deviation.record()}
    in_air = {} if work.lifted is None else {"lifted": work.lifted.record()}
    yields = {} if work.yielding is None else {"yielding": work.yielding.record()}
    refuted = {} if work.refuted_tip is None else {"refuted_tip": work.refuted_tip.record()}
    side = {} if work.side is None else {"wrong_side": work.side.record()}
    sparse = {} if work.sparse is None else {"sparse_samples": work.sparse.record()}
    behind = {} if work.backlash is None else {"backlash": work.backlash.record()}
    curved = {} if work.curvature is None else {"curvature": work.curvature.record()}
    proven = {} if work.estimate is None else {"estimated_surface": work.estimate.certainty()}
    work.model = ObjectModel.attach(
        work.base,
        in_model_frame(work.features, work.base),
        provenance=_provenance(work)
        | {"inspection": work.inspected.record()}
        | surface
        | path
        | in_air
        | yields
        | deviation
        | refuted
        | side
        | sparse
        | behind
        | curved
        | proven
        | rough,
        inspected=work.inspected.height,
        **({} if work.estimate is None else base_reach(work.base.surface, work.estimate)),
        dropped=work.dropped,
        deviation=work.deviation.heights if work.deviation and work.deviation.of_the_model else None,
    )
    if work.tolerances:
        swept = swept_share(work.inspected, work.account, work.base)
        limit = work.detections.detection_limit
        work.judgements = judged(work.model.features, work.tolerances, limit, swept)
        record = [each.record() for each in work.judgements]
        work.model = replace(work.model, provenance=work.model.provenance | {"tolerances": record})


def why_no_standard_heights(work: Work) -> str | None:
    """The standards know sections of lines; a log that was searched while it was read has none any more."""
    if work.log.detections:
        return None
    lines = any(has_sections(feature) for feature in work.model.features)
    return "" if lines else "there is no ridge, groove or step, and nothing wide in a profile"


def standard_heights_taken(work: Work, share: Share) -> None:
    """What ridges, grooves and steps measure by the standards, beside ours."""
    work.standard_heights = standard_heights(work.laid, work.model.features)
    record = [each.record() for each in work.standard_heights]
    work.model = replace(work.model, provenance=work.model.provenance | {"standard_heights": record})


def in_model_frame(features: tuple[Feature, ...], base: Base) -> tuple[Feature, ...]:
    """The features with their axes also in the frame of the given mesh, where the object does not stand as given."""
    pose = Pose.of(base)
    if pose is None:
        return features

    return tuple(
        replace(feature, extra=feature.extra | {"axis_in_model_frame": pose.back(feature.axis).tolist()})
        for feature in features
    )


def why_no_time_curve(work: Work) -> str:
    """Errors need a truth."""
    if not work.truth:
        return "no true feature is stated"
    return "" if work.model.features else "nothing was found"


def compared_in_time(work: Work, share: Share) -> None:
    """The worst error of an axis against the finger's time."""
    work.time_curve = time_curve(work.detections, work.laid, work.model, work.truth, share, work.inspections)


def tip_counts(features: tuple[Feature, ...], tip_radius: float) -> tuple[TipCount, ...]:
    """How many features are finer than this tip, and than a larger one."""
    finer = sum(feature.curvature_feature for feature in features)
    counts = [TipCount(tip_radius, finer, len(features) - finer)]
    crests = [feature.details.trace_curvature for feature in features]
    if features and all(crest is not None for crest in crests):
        other = OTHER_TIP * tip_radius
        finer = sum(abs(crest) > 1.0 / (2.0 * other) for crest in crests if crest is not None)
        counts.append(TipCount(other, finer, len(features) - finer))
    return tuple(counts)


def _provenance(work: Work) -> dict[str, Any]:
    log, noise, stop = work.log, work.detections.noise, stop_of(work.log)
    return {
        "software": f"explore3d {__version__}",
        "scene": work.scene.title if work.scene else None,
        "tip_radius": log.trace.tip_radius,
        "tip_sd": work.tip_sd,
        "tip_sd_assumed": log.tip_sd_assumed,
        "timed": log.timed,
        "form": asdict(log.form),
        "recorded": log.metadata.get("started"),
        "about": {name: value for name, value in vars(work.scene.about).items() if value} if work.scene else {},
        "seed": work.settings.seed,
        "log_sha256": log.sha256,
        "felt_sha256": log.felt_sha256,
        "samples": len(log.trace),
        "recovered": log.recovered,
        "stopped": None if stop is None else stop.text,
        "complete": stop is None or not stop.incomplete,
        "read_as": log.metadata.get("read_as", []),
        "average": log.metadata.get("average"),
        "noise": noise.record,
        "detection_limit": work.detections.detection_limit,
        "narrowest_groove": narrowest_groove(work.detections.detection_limit, log.trace.tip_radius),
        "limit_measured": {"injected": work.detections.injected, "recovered": work.detections.recovered},
        "warnings": list(work.detections.remarks),
        "false_alarms_per_metre": work.settings.false_alarms_per_metre,
    }
