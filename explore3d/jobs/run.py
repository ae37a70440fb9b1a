"""run: the finger explores what the scene describes; then its log is analysed like any other."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path

from explore3d import UserError, __version__
from explore3d.analysis import Analysis, Progress, Stages, silent, without_needless_dynamics
from explore3d.jobs.conclude import conclude
from explore3d.jobs.expedition import explorer, known_base
from explore3d.jobs.resume import EARLIER, Replay, earlier_log
from explore3d.jobs.session import Session
from explore3d.log import Log, Recorder, read_base
from explore3d.scene import Scene, load_scene
from hw import Finger, Move, open_finger
from hw.simulated import Dynamics
from mapping import Trace


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
        known_base(scene)  # a mesh that cannot be used is refused before a folder is made
        finger = scene_finger(without_needless_dynamics(scene, stages), arm)
    replay = None
    if resume:
        log, content = earlier_log(out)
        replay = Replay(log)
    with Session(out) as session:
        session.write("scene.toml", scene.resolved)
        if resume:
            session.write(EARLIER, content)
        log = _explore(scene, finger, session, stages, replay)
        return conclude(session, log, scene, read_base(log.events), stages)


def scene_finger(scene: Scene, arm: bool = False) -> Finger:
    """The finger that the scene names; entering it connects. Raises SceneError, FingerError."""
    table = scene.finger
    if table.machine is not None:
        from explore3d.jobs.machine_finger import machine_finger

        return machine_finger(scene, arm)
    noise, inert = table.noise, {}
    if table.dynamics is not None:
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


def _explore(scene: Scene, finger: Finger, session: Session, stages: Stages, replay: Replay | None = None) -> Log:
    """Carry out the exploration; every sample is in the session's log before the next move begins."""
    with stages.stage("exploration") as share, finger:
        about = {"software": f"explore3d {__version__}", "seed": scene.seed, "finger": finger.info}
        log = session.open_log(
            tip_radius=scene.tip.radius,
            scene_text=scene.resolved,
            metadata=about,
            resolution=finger.info.get("resolution", 0.0),
        )
        if hasattr(finger, "notice"):
            finger.notice = log.felt  # a slow sweep's samples are on disk before it ends
        touch = finger.execute if replay is None else replay.before(finger.execute, getattr(finger, "skip", None))
        execute = _logged(touch, log, scene.explore.time_budget, share)
        outcome = explorer(scene, finger.workspace).go(execute, log.event)
        # what the connection counted and learnt of its clocks on the way
        log.event("outcome", {"reason": outcome.reason, "detail": outcome.detail, "finger": finger.info})
        if not log.samples:
            raise UserError(f"{session.folder}: nothing was felt: {outcome.detail or outcome.reason}")
        log.close()  # its digest goes into the model
        return log.recorded()


def _logged(
    touch: Callable[[Move], Trace], log: Recorder, budget: float, share: Callable[[float], None]
) -> Callable[[Move], Trace]:
    def execute(move: Move) -> Trace:
        trace = touch(move)
        log.write(move, trace)
        if len(trace):
            share(min(1.0, float(trace.t[-1]) / budget))
        return trace

    return execute
