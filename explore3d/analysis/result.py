"""Analysis: everything that one run or one log led to, as the report takes it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from explore3d import seconds_text
from mapping import LeftOut, Trace
from mapping.base import Base
from mapping.model import Judgement, ObjectModel

if TYPE_CHECKING:
    from explore3d.analysis.inspected import Inspected
    from explore3d.analysis.roughness import Roughness
    from explore3d.analysis.standard_heights import StandardHeight
    from explore3d.analysis.surface_account import SurfaceAccount
    from explore3d.analysis.truth import Comparison, TrueFeature
    from explore3d.log import Stop
    from explore3d.scene import Scene
    from mapping.detection import Detections
    from mapping.detection.path import Lifted, PathLedger, SparseSamples
    from mapping.estimate.deviation import Deviation, Yielding
    from mapping.estimate.envelope import Estimate, RefutedTip, WrongSide
    from mapping.geometry.curvature import Curvature


@dataclass(frozen=True)
class TipCount:
    """How the same trace would be read with a tip of another radius.

    Args:
        tip_radius: m.
        finer: features that meet the paper's definition 1 at this radius (curvature features).
        gentler: features that stand out of the noise but are gentler than this tip.
    """

    tip_radius: float
    finer: int
    gentler: int


@dataclass(frozen=True)
class Computing:
    """What a run's planning and modelling took of one core, the simulation of a finger apart; s of CPU time.

    Args:
        planning: choosing, checking and routing moves, looking at what they felt, and writing it down.
        modelling: from the log to the model.
        median_wait, worst_wait: of the finger for a move; the first one's is not among them, nothing moves before it.
    """

    planning: float
    modelling: float
    median_wait: float
    worst_wait: float

    def sentence(self, finger_seconds: float) -> str:
        """In words, against the time that the finger moved (s)."""
        took = self.planning + self.modelling
        share = f", {100 * took / finger_seconds:.0f} % of the finger's time" if finger_seconds > 0 else ""
        return (
            f"Planning took {seconds_text(self.planning)} and modelling {seconds_text(self.modelling)} of one "
            f"core{share}; for its next move the finger waited {1e3 * self.median_wait:.0f} ms (median) and "
            f"{1e3 * self.worst_wait:.0f} ms at worst."
        )


@dataclass(frozen=True, eq=False)
class Analysis:
    """The result of `analyze`, and what it rests on.

    Args:
        title: of the report.
        trace: every sample that was used, on its base.
        base: the global model.
        detections: what the detectors said, with noise and detection limit.
        model: the annotated model.
        scene: None for a log without one.
        estimate: the estimated surface, None if it was left out.
        curvature: principal curvatures at the vertices of `estimate.surface`, None if left out.
        truth: true features that the scene states.
        errors: found features against the true ones.
        timings: seconds per stage, in the order of the stages.
        left_out: stages that were not needed or could not be done.
        recovered: one sentence if the log was damaged and recovered, else "".
        ended: one sentence saying why the exploration ended, "" for a log.
        time_curve: (seconds of finger time, worst error of an axis in m) while exploring, if known.
        tip_counts: counts of finer and gentler features, this tip's radius first.
        inspected: above which height each face is free of features that were not found; None if not asked.
        stopped: why the exploration ended early, None if it did not.
        go_on: the command that goes on with it, "" if there is none.
        folder: where it was written, None if it was not.
        account: which part of the surface was swept, and what became of the rest; None without a scene.
        path: what became of the path that was recorded; None for a log that was searched while it was read.
        lifted: what of the recording is no contact, and was left out; None if nothing is known to be.
        yielding: what the finger yields by under the recorded forces, put back; None if nothing is known of it.
        deviation: what the given model gets wrong at long wavelengths, None if nothing.
        refuted_tip: what the trace says against the radius of the tip, None if nothing.
        side: what the trace says against the side of the path that the body was taken to lie on, None if nothing.
        sparse: what lies unfelt between samples that are further apart than the ball is wide, None if they are not.
        judgements: what became of each tolerance.
        roughness: what the surface is like beside the features; None where a trace cannot tell.
        standard_heights: what its ridges, grooves and steps measure by the standards.
        computing: what a run's planning and modelling took; None where nothing was planned.
    """

    title: str
    trace: Trace
    base: Base
    detections: Detections
    model: ObjectModel
    scene: Scene | None = None
    estimate: Estimate | None = None
    curvature: Curvature | None = None
    truth: tuple[TrueFeature, ...] = ()
    errors: tuple[Comparison, ...] = ()
    timings: dict[str, float] = field(default_factory=dict)
    left_out: tuple[LeftOut, ...] = ()
    recovered: str = ""
    ended: str = ""
    time_curve: tuple[tuple[float, float], ...] = ()
    tip_counts: tuple[TipCount, ...] = ()
    inspected: Inspected | None = None
    stopped: Stop | None = None
    go_on: str = ""
    folder: Path | None = None
    account: SurfaceAccount | None = None
    path: PathLedger | None = None
    lifted: Lifted | None = None
    yielding: Yielding | None = None
    deviation: Deviation | None = None
    refuted_tip: RefutedTip | None = None
    side: WrongSide | None = None
    sparse: SparseSamples | None = None
    judgements: tuple[Judgement, ...] = ()
    roughness: Roughness | None = None
    standard_heights: tuple[StandardHeight, ...] = ()
    computing: Computing | None = None

    def __repr__(self) -> str:
        return f"<Analysis of {self.title!r}: {self.trace!r}, {self.model!r}>"

    @property
    def refused(self) -> bool:
        """True if nothing was looked for, since the model is wrong beyond repair."""
        return self.deviation is not None and self.deviation.beyond_repair
