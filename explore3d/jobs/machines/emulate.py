"""Emulated hardware: a Grbl machine with a round tip over a mesh, on pseudo-terminals."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from types import TracebackType

import numpy as np

from explore3d import UserError
from explore3d.scene import load_mesh
from hw import FingerError
from hw.emulated import ForceEmulator, GrblEmulator, LineSensorEmulator, OptoForceEmulator, PtyServer, TouchedBody
from hw.grbl import StageFrame

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Emulation:
    """What is emulated.

    Args:
        mesh, units: the body that is touched.
        tip_radius: m.
        origin, turn: where the object stands on the machine, m, and how it is turned (rotation vector, rad).
        sensor: "optoforce", "line", or None for a touch probe alone.
        sensor_turn: rotation vector that turns the sensor's axes into the machine's, rad.
        stiffness: of the tip, N/m.
        counts_per_newton: of the OptoForce.
        force_noise: N; repeatability: of the probe, m; seed: of both.
        locked: begin in the alarm state, as a machine that was just switched on.
        pace: emulated seconds per second.
        banner: what the firmware calls itself.
    """

    mesh: Path
    units: str = "m"
    tip_radius: float = 0.01
    origin: Vector = (-0.15, -0.15, -0.05)
    turn: Vector = (0.0, 0.0, 0.0)
    sensor: str | None = None
    sensor_turn: Vector = (0.0, 0.0, 0.0)
    stiffness: float = 1e4
    counts_per_newton: float = 400.0
    force_noise: float = 0.003
    repeatability: float = 0.0
    seed: int = 1
    locked: bool = False
    pace: float = 1.0
    banner: str = "Grbl 1.1h"

    def devices(self) -> list[GrblEmulator | ForceEmulator]:
        """The controller, and the sensor if there is one. Raises UserError: the object is out of reach."""
        surface = load_mesh(self.mesh, self.units)
        frame = StageFrame.of(self.origin, self.turn)
        body = TouchedBody(surface, self.tip_radius, frame, self.stiffness)
        stage = GrblEmulator(
            body,
            np.zeros(3),
            locked=self.locked,
            repeatability=self.repeatability,
            seed=self.seed,
            banner=self.banner,
        )
        corners = frame.to_machine(surface.vertices)
        travel = np.array([stage.settings[130 + axis] * 1e-3 for axis in range(3)])
        middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        above = corners[:, 2].max() + 1.5 * self.tip_radius
        if (middle[:2] < -travel[:2]).any() or (middle[:2] > 0).any() or above > 0.0:
            low, high = np.round(1e3 * corners.min(axis=0), 1).tolist(), np.round(1e3 * corners.max(axis=0), 1).tolist()
            raise UserError(
                f"the object stands at {low} to {high} mm in machine coordinates; the emulated machine reaches "
                f"{(-1e3 * travel).tolist()} to [0, 0, 0] mm and needs room for the tip above: change the origin"
            )
        stage.motion.position = np.array([*middle[:2], min(0.0, above + self.tip_radius)])
        if self.sensor is None:
            return [stage]
        sensor: ForceEmulator = (
            OptoForceEmulator(stage, self.counts_per_newton, noise=self.force_noise, seed=self.seed)
            if self.sensor == "optoforce"
            else LineSensorEmulator(stage, noise=self.force_noise, seed=self.seed)
        )
        sensor.turned = StageFrame.of(turn=self.sensor_turn).rotation
        return [stage, sensor]


def serve(emulation: Emulation, folder: Path) -> PtyServer:
    """The server of an emulation; its ports are the links `stage` and `sensor` in the folder."""
    devices = emulation.devices()
    return PtyServer(
        devices, pace=emulation.pace, links=[folder / name for name in ("stage", "sensor")[: len(devices)]]
    )


class EmulatorProcess:
    """An emulator in a process of its own, for as long as the `with` block runs.

    Args:
        emulation: what to emulate.
    """

    def __init__(self, emulation: Emulation) -> None:
        self.emulation = emulation
        self._folder = tempfile.TemporaryDirectory(prefix="explore3d-")
        self._process: subprocess.Popen[str] | None = None

    @property
    def ports(self) -> list[str]:
        """Names of the stage's and the sensor's port."""
        return [str(Path(self._folder.name) / name) for name in ("stage", "sensor")]

    def __enter__(self) -> EmulatorProcess:
        settings = json.dumps(asdict(self.emulation) | {"mesh": str(self.emulation.mesh)})
        self._process = subprocess.Popen(
            [sys.executable, "-m", "explore3d.jobs.machines.emulate", self._folder.name, settings],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,  # Ctrl-C must reach the driver alone: the machine stays until it has retreated
        )
        assert self._process.stdout is not None and self._process.stderr is not None
        if self._process.stdout.readline().strip() != "ready":
            said = self._process.stderr.read().strip().splitlines()
            self._process.wait()
            raise FingerError(f"the emulator did not start: {said[-1] if said else 'it said nothing'}")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        if self._process is not None:
            self._process.terminate()
            try:
                self._process.communicate(timeout=3.0)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.communicate()
        self._folder.cleanup()


def main(folder: str, settings: str) -> None:
    """Serve until standard input closes, that is until whoever started this is gone."""
    record = json.loads(settings)
    emulation = Emulation(**record | {"mesh": Path(record["mesh"])})
    with serve(emulation, Path(folder)) as server:
        print("ready", flush=True)
        sys.stdin.read()
        time.sleep(0.0 if server.error is None else 0.1)


if __name__ == "__main__":
    main(*sys.argv[1:3])
