"""run: the finger explores what the scene describes; then its log is analysed like any other."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path
from typing import TYPE_CHECKING

from explore3d import __version__
from explore3d.analysis import Analysis
from explore3d.analyze import conclude
from explore3d.base_record import KIND, base_event
from explore3d.errors import SceneError
from explore3d.log import LogWriter
from explore3d.log_reader import read_log
from explore3d.resume import EARLIER, Replay, earlier_log
from explore3d.scene import Scene, load_scene
from explore3d.session import LOG, Session
from explore3d.stages import Progress, Stages, silent
from hw.finger import Finger, open_finger
from hw.moves import Move
from mapping.base import Base
from mapping.trace import Trace
from planners.plan import Outcome

if TYPE_CHECKING:
    from planners.explore import Explore


def run(
    scene: Scene | Path | str,
    out: Path | str,
    *,
    progress: Progress = silent,
    force: Collection[str] = (),
    arm: bool = False,
    resume: bool = False,
) -> Analysis:
    """Explore, log, and build the annotated model.

    Args:
        scene: a scene or its file.
        out: folder for the resolved scene, the log, the model and the report.
        progress: told the stage and the share of it that is done.
        force: stages to run although the scene does not need them.
        arm: let a real machine move; without it every move is refused.
        resume: go on from the log of a session that was broken off in that folder.

    Raises:
        UserError: a scene or folder that cannot be used.
        FingerError: the finger cannot be opened or is lost.
    """
    stages = Stages(progress, force)
    with stages.stage("setting up"):
        scene = scene if isinstance(scene, Scene) else load_scene(scene)
        base = known_base(scene)
        finger = scene_finger(scene, arm)
    replay = None
    if resume:
        log, content = earlier_log(out)
        replay = Replay(log)
    with Session(out) as session:
        session.write("scene.toml", scene.resolved)
        if resume:
            session.write(EARLIER, content)
        outcome = _explore(scene, base, finger, session, stages, replay)
        log = read_log(session.folder / LOG)
        return conclude(session, log, scene, base, stages, ended=outcome.detail or outcome.reason)


def known_base(scene: Scene) -> Base:
    """The global model that the scene gives. Raises SceneError."""
    surface = scene.base_surface()
    if surface is None:
        raise SceneError(f"{scene.path}: model.mesh: a global mesh is needed to plan sweeps over; found none")
    return Base(surface)


def scene_finger(scene: Scene, arm: bool = False) -> Finger:
    """The finger that the scene names; entering it connects. Raises SceneError, FingerError."""
    table = scene.finger
    if table.machine is not None:
        from explore3d.machine_finger import machine_finger

        return machine_finger(scene, arm)
    noise, inert = table.noise, {}
    if table.dynamics is not None:
        from hw.dynamics import Dynamics

        inert = {"dynamics": Dynamics(**table.dynamics.model_dump())}
    return open_finger(
        "dynamic" if inert else table.kind,
        **inert,
        object=scene.object_surface(),
        tip_radius=scene.tip.radius,
        rate=table.rate,
        contact_data=table.contact_data,
        white=noise.white,
        correlated=noise.correlated,
        correlation_length=noise.correlation_length,
        angle=noise.angle,
        contact=noise.contact,
        seed=scene.seed,
    )


def _explore(
    scene: Scene, base: Base, finger: Finger, session: Session, stages: Stages, replay: Replay | None = None
) -> Outcome:
    """Carry out the plan; every sample is in the session's log before the next move begins."""
    from planners.checks import Limits
    from planners.drive import drive

    with stages.stage("exploration") as share, finger:
        about = {"software": f"explore3d {__version__}", "seed": scene.seed, "finger": finger.info}
        log = session.open_log(
            tip_radius=scene.tip.radius,
            scene_text=scene.resolved,
            metadata=about,
            resolution=finger.info.get("resolution", 0.0),
        )
        log.event(KIND, base_event(base))
        if hasattr(finger, "notice"):
            finger.notice = log.felt  # a slow sweep's samples are on disk before it ends
        touch = finger.execute if replay is None else replay.before(finger.execute)
        execute = _logged(touch, log, scene.explore.time_budget, share)
        limits = Limits.of(finger.workspace, base, scene.tip.radius)
        _, outcome = drive(
            explorer(scene, base).plan(),
            execute,
            check=limits.violation,
            note=lambda text: log.event("refused", {"what": text}),
        )
        log.event("outcome", {"reason": outcome.reason, "detail": outcome.detail})
        log.close()  # its digest goes into the model
    return outcome


def explorer(scene: Scene, base: Base) -> Explore:
    """The exploratory procedure with the scene's settings."""
    from planners.explore import Explore

    return Explore(
        base=base,
        tip_radius=scene.tip.radius,
        smallest=scene.survey.smallest_feature,
        shortest_ridge=scene.survey.shortest_ridge,
        precision=scene.explore.precision,
        time_budget=scene.explore.time_budget,
        speed=scene.survey.speed,
        force=scene.survey.force,
        false_alarms_per_metre=scene.detection.false_alarms_per_metre,
    )


def _logged(
    touch: Callable[[Move], Trace], log: LogWriter, budget: float, share: Callable[[float], None]
) -> Callable[[Move], Trace]:
    def execute(move: Move) -> Trace:
        trace = touch(move)
        log.write(move, trace)
        if len(trace):
            share(min(1.0, float(trace.t[-1]) / budget))
        return trace

    return execute
