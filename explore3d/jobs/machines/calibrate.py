"""calibrate, selftest: what sweeps over a reference sphere say of the tip, its noise, and how fast it scans."""

from __future__ import annotations

import json
import time
import tomllib
from collections.abc import Collection
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import IO, Any

import numpy as np
from numpy.typing import ArrayLike

from explore3d import UserError, __version__, count_text
from explore3d.jobs import Execute, Replay, cause, locked, open_scene, scene_finger, undisturbed
from explore3d.log import OUTCOME, LogWriter, read_log
from explore3d.scene import Scene, scene_text
from hw import Finger, Move
from hw.probing import GrblFinger
from mapping import Interval, Trace, length_text
from mapping.geometry.mesh import write_whole
from mapping.instrument import TipCalibration, calibrate_tip

PROFILE = "explore3d/tip/1"


@dataclass(frozen=True, eq=False)
class TipProfile:
    """A calibrated tip.

    Args:
        tip: what the reference said.
        delay: force sensor behind stage, s, and its standard error; None without a sensor.
        seconds: how long the sweeps took.
        finger: what was calibrated.
    """

    tip: TipCalibration
    delay: tuple[float, float] | None
    seconds: float
    finger: dict[str, Any]

    def record(self) -> dict[str, Any]:
        """JSON values, SI units."""
        delay = {} if self.delay is None else {"delay": self.delay[0], "delay_sd": self.delay[1]}
        return {"schema": PROFILE, "software": f"explore3d {__version__}", "time": self.seconds} | (
            self.tip.record() | delay | {"finger": self.finger}
        )

    def lines(self) -> list[str]:
        """The same in words."""
        tip, noise = self.tip, self.tip.noise
        center = ", ".join(length_text(float(value), 2) for value in tip.center)
        center_sd = ", ".join(length_text(float(value), 2) for value in tip.center_sd)
        correlated = f", {length_text(noise.correlated)} correlated over {length_text(noise.length)}"
        lines = [
            f"tip radius {Interval(tip.radius, *tip.interval)}, a 90 % interval",
            f"centre of the sphere at ({center}), standard deviations {center_sd}",
            f"noise of a sample {length_text(noise.white)} white{correlated if noise.correlated > 0.0 else ''}",
            f"largest mean deviation by direction {length_text(float(np.abs(tip.deviations).max()), 2)}",
        ]
        if self.delay is not None:
            lines.append(f"force sensor {1e3 * self.delay[0]:.2f} ± {1e3 * self.delay[1]:.2f} ms behind the stage")
        return lines


def calibrate(
    scene: Scene | Path | str,
    radius: float,
    center: tuple[float, float, float],
    *,
    lines: int = 24,
    radius_sd: float = 0.0,
    arm: bool = False,
    recording: Recording | None = None,
    files_from: Collection[Path | str] = (),
) -> TipProfile:
    """Sweep over a reference sphere and fit tip and noise to it.

    Args:
        scene: names the finger and the nominal tip.
        radius, radius_sd: of the sphere, and its standard uncertainty, m.
        center: of the sphere, about, m, object frame.
        lines: sweeps over the sphere.
        arm: let a real machine move.
        recording: entered; keeps every sweep as soon as it is made.
        files_from: folders that the scene may name files in, beside those near it.

    Raises:
        FingerError: the finger is lost, or not armed.
        CalibrationError: the contacts do not determine the tip.
    """
    scene = open_scene(scene, files_from)
    if not radius > 0.0:
        raise UserError(f"radius of the reference sphere: should be greater than 0; found {radius:g} m")
    scene.check_size("the reference sphere", 2.0 * radius)
    delay = None
    with scene_finger(scene, arm) as finger:
        begun = time.monotonic()
        trace = _swept(finger, scene, radius, center, lines, recording)
        seconds = time.monotonic() - begun
        if isinstance(finger, GrblFinger) and finger.slide is not None:
            delay = finger.measured_delay()
        return TipProfile(calibrate_tip(trace, radius, reference_sd=radius_sd), delay, seconds, finger.info)


class Recording:
    """The sweeps of a calibration on disk, and the place of its profile: both checked before anything moves.

    A context manager. The sweeps go into `tip-1.mcap` beside `tip.toml`, or the next free number: no recording is ever
    written over. An earlier profile stays until the new one is whole.

    Args:
        profile: where the profile belongs.
        again: the command that begins again, or goes on.
        resume: go on with the recording of the highest number.

    Raises:
        UserError: (on entering) the place cannot be written, holds something that is no tip profile, another
            calibration writes there, or there is nothing to go on with.
    """

    def __init__(self, profile: Path | str, again: str = "", resume: bool = False) -> None:
        self.profile, self.again, self.resume = Path(profile), again, resume
        self.log: LogWriter | None = None
        self.replay: Replay | None = None
        self.sweeps, self.planned = 0, 0
        self._source: Path | None = None
        self._begun: Path | None = None
        self._lock: IO[bytes] | None = None
        self._made: list[Path] = []

    def __enter__(self) -> Recording:
        if self.profile.exists():
            try:
                known = tomllib.loads(self.profile.read_text("utf-8")).get("schema")
            except (OSError, ValueError):
                known = None
            if known != PROFILE:
                raise UserError(f"{self.profile}: is in the way and no tip profile; choose another --out")
        try:
            missing = [each for each in (self.profile.parent, *self.profile.parent.parents) if not each.exists()]
            self.profile.parent.mkdir(parents=True, exist_ok=True)
            self._made = missing
            self._lock = self._draft.open("ab")
        except OSError as error:
            raise UserError(f"{self.profile}: cannot write the tip profile: {error.strerror}") from error
        if not locked(self._lock.fileno()):
            self._lock.close()
            raise UserError(f"{self.profile}: another calibration is writing there; choose another --out")
        try:
            self._find_source()
        except BaseException:
            self._leave()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        with undisturbed():
            samples = 0 if self.log is None else self.log.samples
            if self.log is not None:
                with suppress(UserError):  # a full disk: what is in the file already is whole
                    self.log.close("closed" if error is None else f"{type(error).__name__}: {error}")
            if self._begun is not None and not samples:  # a signal may have come while the log was being made
                self._begun.unlink(missing_ok=True)
            self._leave()
            if error is not None and self.log is not None and samples:
                error.add_note(f"stopped after {self.sweeps} of {count_text(self.planned, 'sweep')}: {cause(error)}")
                go_on = f"; go on with: {self.again} --resume" if self.again else ""
                error.add_note(f"kept: {self.log.path}, and no profile was written{go_on}")
            elif error is not None and (not isinstance(error, Exception) or isinstance(error, OSError)):
                again = f"; begin again with: {self.again}" if self.again else ""
                error.add_note(f"nothing was recorded, {self.profile} is as it was{again}")

    def begin(self, scene: Scene, finger: Finger, lines: int) -> Execute:
        """The way to carry out a move and keep what it gave; the finger is connected."""
        about = {"software": f"explore3d {__version__}", "job": "calibrate", "finger": finger.info}
        resolution = finger.info.get("resolution", 0.0)
        path = self._numbered(1 + max(self._numbers(), default=0))
        self._begun = path
        log = LogWriter(
            path,
            tip_radius=scene.tip.radius,
            scene_text=scene.resolved,
            metadata=about,
            resolution=resolution,
        )
        self.log, self.planned = log, lines
        touch: Execute = finger.execute
        if self.replay is not None:
            touch = self.replay.before(finger.execute, getattr(finger, "skip", None))

        def execute(move: Move) -> Trace:
            trace = touch(move)
            log.write(move, trace)
            self.sweeps += 1
            return trace

        return execute

    def write(self, profile: TipProfile) -> None:
        """The profile in its place; the recording says "done" and is not gone on with. Raises UserError."""
        write_profile(profile, self.profile)
        if self.log is not None:
            self.log.event(OUTCOME, {"reason": "done"})

    def _find_source(self) -> None:
        if not self.resume:
            return
        numbers = self._numbers()
        if not numbers:
            raise UserError(f"{self.profile}: nothing to resume: no {self._numbered(1).name}; leave --resume out")
        self._source = self._numbered(max(numbers))
        self.replay = Replay(read_log(self._source))

    def _numbered(self, number: int) -> Path:
        return self.profile.with_name(f"{self.profile.stem}-{number}.mcap")

    def _numbers(self) -> list[int]:
        ends = [path.stem.removeprefix(f"{self.profile.stem}-") for path in self.profile.parent.glob("*.mcap")]
        return [int(end) for end in ends if end.isdecimal() and self._numbered(int(end)).exists()]

    @property
    def _draft(self) -> Path:
        return self.profile.with_name(f".{self.profile.name}.lock")

    def _leave(self) -> None:
        if self._lock is not None:
            self._draft.unlink(missing_ok=True)
            self._lock.close()
        for folder in self._made:  # the deepest first
            with suppress(OSError):  # something lies in it: a recording, or a profile
                folder.rmdir()


def write_profile(profile: TipProfile, path: Path) -> None:
    """The profile as TOML, for `profile = "..."` in a scene's [tip]; whole or not at all. Raises UserError."""
    record = {key: value for key, value in profile.record().items() if key != "finger"}
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, scene_text(record))
    except OSError as error:
        raise UserError(f"{path}: cannot write the tip profile: {error.strerror}") from error


def selftest(
    scene: Scene | Path | str,
    radius: float,
    center: tuple[float, float, float],
    *,
    arm: bool = False,
    files_from: Collection[Path | str] = (),
) -> dict[str, float]:
    """Range of radii over a reference sphere, scanned along four lines, with the time it took (as ISO 10360 pairs).

    Returns:
        range (m), time (s), samples, sd (m) of the radii, and tip_radius (m) as found.

    Raises:
        FingerError, CalibrationError: as for `calibrate`.
    """
    profile = calibrate(scene, radius, center, lines=4, arm=arm, files_from=files_from)
    tip = profile.tip
    spread = float(np.hypot(tip.noise.white, tip.noise.correlated))
    return {
        "range": tip.range,
        "time": profile.seconds,
        "samples": tip.samples,
        "sd": spread,
        "tip_radius": tip.radius,
    }


def as_json(record: dict[str, Any]) -> str:
    """For --json."""
    return json.dumps(record)


def _swept(
    finger: Any,
    scene: Scene,
    radius: float,
    center: tuple[float, float, float],
    lines: int,
    recording: Recording | None,
) -> Trace:
    speed = min(scene.sweep_speed, finger.workspace.max_speed)
    moves = meridians(center, radius, scene.tip.radius, lines, speed=speed, force=scene.survey.force)
    execute = finger.execute if recording is None else recording.begin(scene, finger, len(moves))
    return Trace.concatenate([execute(move) for move in moves])


def meridians(
    center: ArrayLike,
    radius: float,
    tip_radius: float,
    lines: int,
    *,
    reach: float = np.pi / 3,
    speed: float = 0.03,
    force: float = 1.0,
) -> list[Move]:
    """Sweeps from one side of a sphere over its top (+z) to the other.

    Args:
        center: (3,) of the sphere, m, object frame.
        radius: of the sphere, m.
        lines: how many, evenly turned about z.
        reach: how far down they go from the top, rad.
    """
    angle = np.linspace(-reach, reach, 121)
    moves = []
    for number in range(lines):
        turn = np.pi * number / lines
        unit = np.column_stack([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)])
        unit = unit if number % 2 == 0 else unit[::-1]
        path = np.asarray(center) + (radius + 0.98 * tip_radius) * unit
        moves.append(Move(path, -unit, speed=speed, force=force))
    return moves
