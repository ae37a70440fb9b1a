"""calibrate, selftest: what sweeps over a reference sphere say of the tip, its noise, and how fast it scans."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from explore3d import UserError, __version__
from explore3d.jobs.run import scene_finger
from explore3d.scene import Scene, load_scene, scene_text
from hw import Move
from hw.probing import GrblFinger
from mapping import Trace
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
        tip, (low, high) = self.tip, self.tip.interval
        lines = [
            f"tip radius {1e3 * tip.radius:.4f} mm, 90 % between {1e3 * low:.4f} and {1e3 * high:.4f} mm",
            f"centre {np.round(1e3 * tip.center, 4).tolist()} mm, sd {np.round(1e3 * tip.center_sd, 4).tolist()} mm",
            f"noise {1e3 * tip.noise.white:.4f} mm white, {1e3 * tip.noise.correlated:.4f} mm correlated over "
            f"{1e3 * tip.noise.length:.2f} mm",
            f"largest mean deviation by direction {1e3 * float(np.abs(tip.deviations).max()):.4f} mm",
        ]
        if self.delay is not None:
            lines.append(f"force sensor {1e3 * self.delay[0]:.2f} +- {1e3 * self.delay[1]:.2f} ms behind the stage")
        return lines


def calibrate(
    scene: Scene | Path | str,
    radius: float,
    center: tuple[float, float, float],
    *,
    lines: int = 24,
    radius_sd: float = 0.0,
    arm: bool = False,
) -> TipProfile:
    """Sweep over a reference sphere and fit tip and noise to it.

    Args:
        scene: names the finger and the nominal tip.
        radius, radius_sd: of the sphere, and its standard uncertainty, m.
        center: of the sphere, about, m, object frame.
        lines: sweeps over the sphere.
        arm: let a real machine move.

    Raises:
        FingerError: the finger is lost, or not armed.
        CalibrationError: the contacts do not determine the tip.
    """
    scene = scene if isinstance(scene, Scene) else load_scene(scene)
    delay = None
    with scene_finger(scene, arm) as finger:
        begun = time.monotonic()
        trace = _swept(finger, scene, radius, center, lines)
        seconds = time.monotonic() - begun
        if isinstance(finger, GrblFinger) and finger.slide is not None:
            delay = finger.measured_delay()
        return TipProfile(calibrate_tip(trace, radius, reference_sd=radius_sd), delay, seconds, finger.info)


def write_profile(profile: TipProfile, path: Path) -> None:
    """The profile as TOML, for `profile = "..."` in a scene's [tip]. Raises UserError."""
    record = {key: value for key, value in profile.record().items() if key != "finger"}
    part = path.with_name(f".part-{path.name}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_text(scene_text(record), encoding="utf-8")
        part.replace(path)
    except OSError as error:
        raise UserError(f"{path}: cannot write the tip profile: {error.strerror}") from error


def selftest(
    scene: Scene | Path | str, radius: float, center: tuple[float, float, float], *, arm: bool = False
) -> dict[str, float]:
    """Range of radii over a reference sphere, scanned along four lines, with the time it took (as ISO 10360 pairs).

    Returns:
        range (m), time (s), samples, sd (m) of the radii, and tip_radius (m) as found.

    Raises:
        FingerError, CalibrationError: as for `calibrate`.
    """
    profile = calibrate(scene, radius, center, lines=4, arm=arm)
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


def _swept(finger: Any, scene: Scene, radius: float, center: tuple[float, float, float], lines: int) -> Trace:
    speed = min(scene.sweep_speed, finger.workspace.max_speed)
    moves = meridians(center, radius, scene.tip.radius, lines, speed=speed, force=scene.survey.force)
    return Trace.concatenate([finger.execute(move) for move in moves])


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
