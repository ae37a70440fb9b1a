"""run: the finger explores what the scene describes; then its log is analysed like any other."""

from __future__ import annotations

import hashlib
import json
import shlex
import signal
import tomllib
from collections.abc import Callable, Collection
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from explore3d import UserError, __version__, count_text, seconds_text
from explore3d.analysis import FINGER_STAGE, Analysis, Progress, Stages, run_key, silent, without_needless_dynamics
from explore3d.jobs.analyze import Told
from explore3d.jobs.conclude import conclude
from explore3d.jobs.expedition import SurveyWatch, Waits, explorer, known_base
from explore3d.jobs.resume import BROKEN_OFF, Replay, replay_of
from explore3d.jobs.session import Job, Session, unchanged_files
from explore3d.log import EXPLORATION, OUTCOME, Log, read_base, stop_of
from explore3d.scene import FingerNoise, GivenFingerTable, Scene, load_scene
from hw import Finger, Move, wrong_trace
from mapping import Trace, length_text
from mapping.geometry.mesh import algebra_in_one_thread
from planners import Outcome

# Two statements of one tip's radius may differ by rounding
GIVEN_RADIUS_SHARE = 1e-6
# Kind of event: a sweep that the finger ended before its end, and why
CUT_SHORT = "cut short"
# A shell's exit status of a program that a signal ended is this and the signal's number
SIGNAL_EXIT = 128


@algebra_in_one_thread()
def run(
    scene: Scene | Path | str,
    out: Path | str,
    *,
    progress: Progress = silent,
    force: Collection[str] = (),
    arm: bool = False,
    resume: bool = False,
    overwrite: bool = False,
    finger: Finger | None = None,
    files_from: Collection[Path | str] = (),
    report: bool = True,
) -> Analysis:
    """Explore, log, and build the annotated model.

    An earlier session in the folder stays until this one is complete. One that ended early is concluded all the same:
    the result's `stopped` says why, and its `folder` where it is.

    Args:
        scene: a scene or its file.
        out: folder for the resolved scene, the log, the model and the report.
        progress: told the stage and the share of it that is done.
        force: stages to run although the scene does not need them.
        arm: let a real machine move; without it every move is refused.
        resume: go on from the log of a session that was broken off in that folder.
        overwrite: replace, once this one is complete, a session of another scene in that folder.
        finger: explore with this one, not with the one that the scene names; whether it may move is its own affair.
            The session's scene says `kind = "given"`, and keeps what it states of the noise.
        files_from: folders that the scene may name files in, beside those near it.
        report: False to write no report and no pictures.

    Raises:
        UserError: a scene or folder that cannot be used; a finger that returns what it cannot have felt.
        FingerError: the finger cannot be opened or is lost.
    """
    stages, given = Stages(progress, force), finger is not None
    with stages.stage("setting up"):
        scene = open_scene(scene, files_from)
        known_base(scene)  # a mesh that cannot be used is refused before a folder is made
        if finger is None:
            finger = scene_finger(without_needless_dynamics(scene, stages), arm)
        else:
            scene = _with_given(scene, finger)
    again, go_on = _calls(scene, out, force, files_from, arm=arm, report=report, given=given)
    job = Job("run", scene_digest(scene), ("plan",), go_on, again, scene.files)
    with Session(out, job, resume=resume, overwrite=overwrite) as session:
        replay = None if session.source is None else replay_of(session.source)
        session.write("scene.toml", scene.resolved)
        log, waits = _explore(scene, finger, session, stages, replay)
        stop = stop_of(log)
        session.stopped = stop.text if stop is not None and stop.incomplete else ""
        key, base = run_key(log.sha256, Told(force=tuple(force)).record([])), read_base(log.events)
        analysis = conclude(session, log, scene, base, stages, go_on, report=report, run=key, waits=waits)
    return replace(analysis, folder=session.place)


def _calls(
    scene: Scene,
    out: Path | str,
    force: Collection[str],
    files_from: Collection[Path | str],
    *,
    arm: bool,
    report: bool,
    given: bool,
) -> tuple[str, str]:
    """What begins a run again, and what goes on with it: commands, or calls where a program hands the finger in."""
    if given:
        words = [repr(str(scene.path)), repr(str(out)), "finger=..."]
        words += [f"force={[*force]}"] * bool(force) + ["report=False"] * (not report)
        words += [f"files_from={[*map(str, files_from)]}"] * bool(files_from)
        return f"explore3d.run({', '.join(words)})", f"explore3d.run({', '.join([*words, 'resume=True'])})"
    words = [part for name in force for part in ("--force", name)] + ["--arm"] * arm + ["--no-report"] * (not report)
    words += [part for folder in files_from for part in ("--files-from", str(folder))]
    again = shlex.join(["explore3d", "run", str(scene.path), "--out", str(out), *words])
    return again, f"{again} --resume"


def open_scene(scene: Scene | Path | str, files_from: Collection[Path | str] = ()) -> Scene:
    """A scene as it is, or the one in a file; that of a session may name what the session read.

    Raises:
        SceneError: a scene that cannot be used.
    """
    if isinstance(scene, Scene):
        return scene
    return load_scene(scene, [*files_from, *unchanged_files(Path(scene).parent)])


def _with_given(scene: Scene, finger: Finger) -> Scene:
    """The scene of a finger that was handed in. Raises UserError: its tip is another than the scene's."""
    if abs(finger.tip_radius - scene.tip.radius) > GIVEN_RADIUS_SHARE * scene.tip.radius:
        raise UserError(
            f"{scene.path}: tip.radius is {length_text(scene.tip.radius)}, the finger that was handed in has "
            f"{length_text(finger.tip_radius)}"
        )
    noise = FingerNoise(**scene.finger.noise.model_dump(include=set(FingerNoise.model_fields)))
    return scene.with_finger(GivenFingerTable(noise=noise))


def scene_digest(scene: Scene) -> str:
    """What makes two scenes the same for a session: everything but their title and how far the exploration may go."""
    tables = tomllib.loads(scene.resolved)
    tables.pop("title", None)
    for name in ("time_budget", "precision"):
        tables.get("explore", {}).pop(name, None)
    return hashlib.sha256(json.dumps(tables, sort_keys=True, default=str).encode()).hexdigest()


def cause(error: BaseException) -> str:
    """Why a job ended, in a few words."""
    if isinstance(error, KeyboardInterrupt):
        return "interrupted (Ctrl-C)"
    if isinstance(error, SystemExit) and isinstance(error.code, int) and error.code > SIGNAL_EXIT:
        return f"terminated ({signal.Signals(error.code - SIGNAL_EXIT).name})"
    if isinstance(error, OSError) and error.filename and error.strerror:
        return f"{error.filename}: {error.strerror}"  # without its number
    return " ".join(str(error).split()) or type(error).__name__


def scene_finger(scene: Scene, arm: bool = False) -> Finger:
    """The finger that the scene names; entering it connects. Raises SceneError, FingerError."""
    return scene.open_finger(arm)


def _explore(
    scene: Scene, finger: Finger, session: Session, stages: Stages, replay: Replay | None = None
) -> tuple[Log, Waits]:
    """Carry out the exploration; every sample is in the session's log before the next move begins."""
    with stages.stage(FINGER_STAGE) as share, finger:
        about = {"software": f"explore3d {__version__}", "seed": scene.seed, "finger": finger.info} | EXPLORATION
        log = session.open_log(
            tip_radius=scene.tip.radius,
            scene_text=scene.resolved,
            metadata=about,
            resolution=finger.info.get("resolution", 0.0),
        )
        if replay is None:
            session.settle()  # there is no earlier log, or nothing in it
        if hasattr(finger, "notice"):
            finger.notice = log.felt  # a slow sweep's samples are on disk before it ends
        if hasattr(finger, "waiting"):
            finger.waiting = lambda what: stages.progress(what, 0.0)

        def touch(move: Move) -> Trace:
            trace = finger.execute(move)
            if wrong := wrong_trace(move, trace, finger.workspace):
                raise UserError(wrong)  # no refusal of one move: a driver does the same to every one
            return trace

        touched: Callable[[Move], Trace] = touch
        if replay is not None:
            log.event("resumed", {"samples": replay.samples})
            touched = replay.before(touch, getattr(finger, "skip", None), log.write)

        cut_short: list[str] = []
        waits = Waits(touched, finger.workspace.max_speed)

        def execute(move: Move) -> Trace:
            trace = waits(move)
            log.write(move, trace)
            told = finger.info.get("cut_short", []) if move.purpose == "sweep" else []
            if len(told) > len(cut_short):
                cut_short[:] = told
                log.event(CUT_SHORT, {"sweep": int(trace.sweep[-1]) if len(trace) else None, "reason": told[-1]})
            if replay is not None and replay.live:
                session.settle()  # everything that the earlier log holds is in this one
            if len(trace):
                share(min(1.0, float(trace.t[-1]) / scene.explore.time_budget))
            return trace

        watch = SurveyWatch(execute, log.event)
        session.reached = lambda error: watch.stop(cause(error)).text
        try:
            outcome = explorer(scene, finger.workspace).go(watch, log.event, watch, waits.meanwhile)
        except BaseException as error:
            if log.samples:
                stop = watch.stop(cause(error))
                ended = {"reason": BROKEN_OFF, "cause": stop.cause, "finished": False, "sweeps": stop.sweeps}
                with suppress(UserError):  # of a full disk, for example: the log then ends without a word
                    log.event(OUTCOME, ended)
            raise
        finally:
            waits.ended()
        session.reached = lambda error: f"stopped after all sweeps, before the report: {cause(error)}"
        if replay is not None:
            replay.rest(log.write)
        ended = _ended(outcome, watch, scene, cut_short, getattr(finger, "lost", None))
        # what the connection counted and learnt of its clocks on the way
        log.event(OUTCOME, ended | {"finger": finger.info})
        if not log.samples:
            why = watch.refused or outcome.detail or outcome.reason
            raise UserError(f"{session.folder}: nothing was felt: {why}")
        session.settle()
        log.close()  # its digest goes into the model
        return log.recorded(), waits


def _ended(
    outcome: Outcome, watch: SurveyWatch, scene: Scene, cut_short: Collection[str], lost: str | None
) -> dict[str, Any]:
    """Why an exploration ended, as an event of its log; a sweep that ended before its end leaves it incomplete.

    So does a finger that was lost (why): a plan that has few moves left comes to its end without it.
    """
    if lost is not None and outcome.reason != "finger refuses":
        outcome = Outcome("finger refuses", lost)
    why = outcome.detail or outcome.reason
    if outcome.reason == "budget":
        why = f"the time budget of {seconds_text(scene.explore.time_budget)} was used up"
    finished = watch.surveyed and outcome.reason != "finger refuses" and not cut_short
    if cut_short:
        why = f"{count_text(len(cut_short), 'sweep')} cut short: {[*cut_short][-1]}"
    return {
        "reason": outcome.reason,
        "detail": outcome.detail,
        "cause": why,
        "finished": finished,
        "sweeps": watch.made,
    }
