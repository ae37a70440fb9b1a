"""`explore3d run` of a machine that fails, and of a program that is ended: what a user sees, and what the machine did.

The machine lives in this program, the command line in another: the true force and every motion are seen from outside.
Run by itself it prints one line a case:
PYTHONPATH=.:tests/support python tests/support/machines/machine_runs.py faults | signals | resume | quiet
[optoforce | line | peck] [how many times]
"""

from __future__ import annotations

import itertools
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from interrupting import HONEST, ROOT
from scene_files import write_scene_file
from struck_machine import (
    BYTES,
    CONTROLLER_FAULTS,
    FRAME,
    MOST,
    OFF,
    PHASES,
    SENSORS,
    STIFFNESS,
    SURVIVABLE,
    R,
    case_line,
    machine_over,
    own_faults,
    plate,
    strike,
)

from explore3d.log.own.reader import read_log
from hw.emulated.grbl import GrblEmulator
from hw.emulated.pty_server import PtyServer

# Half of the plate, m: with features of 0.4 mm its survey has a handful of sweeps
HALF = (5e-3, 3e-3)
SCENE = """
schema = "explore3d/scene/1"
title = "A bare plate on a machine that fails"
seed = 1
[tip]
radius = "5 mm"
[model]
mesh = "plate.ply"
[finger]
kind = "grbl"
[finger.machine]
port = "{ports[0]}"
origin = ["-150 mm", "-150 mm", "-50 mm"]
touch = "{touch}"
max_force = "5 N"
over_travel = "0.4 mm"
step = "0.5 mm"
probe_speed = "10 mm/s"
position_known = true
check_probe = false
{sensor}
[survey]
smallest_feature = "0.4 mm"
speed = "10 mm/s"
force = "1 N"
[explore]
time_budget = "10 min"
"""
SENSOR = """
[finger.sensor]
kind = "{kind}"
port = "{port}"
rate = "1 kHz"
stiffness = 1e4
"""
SIGNALS = {"SIGINT": signal.SIGINT, "SIGTERM": signal.SIGTERM, "SIGKILL": signal.SIGKILL, "SIGSTOP 3 s": signal.SIGSTOP}
# After these the program ends by itself, and well: 0; Ctrl-C and kill by their numbers; else what stopped it is said: 3
STATUS = {"SIGINT": (130,), "SIGTERM": (143,), "SIGKILL": (-9,), "SIGSTOP 3 s": (0,)}
# What a user reads first
FIRST_LINE = re.compile(r"^(explore3d: )?stopped after .+: .+; .*go on with: explore3d run .+ --resume", re.MULTILINE)


class Witness:
    """Sees the true force and where the tip is, all the time; strikes in a phase of the second sweep."""

    def __init__(self, stage: GrblEmulator) -> None:
        self.out = bytearray()
        self.stage, self.strongest = stage, 0.0
        self.phase, self.strike = "", lambda: None
        self.sweeps, self.touching, self.free = 0, False, True
        self.began, self.struck, self.struck_at = np.zeros(3), 0.0, 0.0

    def await_phase(self, phase: str, strike: Callable[[], None]) -> None:
        self.strike, self.phase = strike, phase

    def receive(self, data: bytes, now: float) -> None: ...

    def advance(self, now: float) -> None:
        self.stage.advance(now)
        place = FRAME.to_object(self.stage.motion.position)
        on_plate = (np.abs(place[:2]) <= HALF).all()
        force = STIFFNESS * max(0.0, R - place[2]) if on_plate else 0.0
        self.strongest = max(self.strongest, force)
        if force > 0.2 and not self.touching:
            self.touching, self.sweeps = True, self.sweeps + 1
            self.began = place
        way = float(np.linalg.norm(place[:2] - self.began[:2]))
        if self.touching and place[2] > R + 1e-3:
            self.touching = False
        if self.struck or not self.phase or self.sweeps < 1:
            return
        if {
            "approach": self.sweeps > 0 and not self.touching and R < place[2] < R + 8e-4,
            "midway": self.sweeps > 1 and force > 0.2 and way > 1e-3,
            "retreat": self.sweeps > 1 and self.touching and force == 0.0 and place[2] > R + 1e-4,
        }[self.phase]:
            self.struck = time.monotonic()
            self.strike()


@dataclass(frozen=True)
class Run:
    """How a run ended: exit status, all that it said, largest true force (N), m moved after its end, wrong and all
    samples of its log, and s from the strike to its end.
    """

    status: int
    said: str
    strongest: float
    moved: float
    wrong: int
    kept: int
    struck: bool
    lasted: float

    @property
    def last(self) -> str:
        """The last line."""
        return (self.said.strip().splitlines() or [""])[-1]

    @property
    def first(self) -> str:
        """The line that says how it ended."""
        found = FIRST_LINE.search(self.said)
        return found.group(0) if found else ""


class Bench:
    """A machine over a plate on its ports, and runs on it; a context manager.

    Args:
        folder: for ports, scene and sessions.
        touch: optoforce, line or peck.
    """

    def __init__(self, folder: Path, touch: str, seed: int = 0) -> None:
        self.folder, self.touch = folder, touch
        self.stage = machine_over(plate(*HALF), 0.015)
        self.witness = Witness(self.stage)
        self.devices: list[object] = [self.stage, self.witness]
        links = [folder / "stage", folder / "witness"]
        if touch != "peck":
            self.devices.append(SENSORS[touch](self.stage, noise=0.003, seed=seed))
            links.append(folder / "sensor")
        self.server = PtyServer(self.devices, links=links)  # type: ignore[arg-type]
        _write_plate(folder / "plate.ply")
        sensor = "" if touch == "peck" else SENSOR.format(kind=touch, port=links[2])
        text = SCENE.format(ports=links, touch="peck" if touch == "peck" else "slide", sensor=sensor)
        self.scene = write_scene_file(folder / "scene.toml", text)

    def __enter__(self) -> Bench:
        self.server.__enter__()
        return self

    def __exit__(self, *ended: object) -> None:
        self.server.__exit__(None, None, None)

    def run(self, *words: str, out: str = "out", strike: tuple[str, str] | None = None) -> Run:
        """Run the scene; in a phase of a sweep, what happens to the machine or to the program, if that is said."""
        command = [sys.executable, "-m", "explore3d", "run", str(self.scene), "--out", str(self.folder / out), "--arm"]
        threads = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        environment = os.environ | {"PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1"} | threads
        self.witness.struck = self.witness.sweeps = 0
        self.witness.phase = ""
        process = subprocess.Popen(
            [sys.executable, "-c", HONEST, *command, "--no-report", *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            env=environment,
            text=True,
        )
        if strike is not None:
            self.witness.await_phase(strike[1], self._strike(strike[0], process))
        said, _ = process.communicate(timeout=600)
        ended = time.monotonic()
        time.sleep(0.1)
        still = self.stage.motion.travelled
        time.sleep(0.3)
        moved = self.stage.motion.travelled - still
        assert self.server.error is None, self.server.error
        wrong, kept = self._samples(out)
        struck = self.witness.struck
        return Run(process.returncode, said, self.witness.strongest, moved, wrong, kept, struck > 0.0, ended - struck)

    def _strike(self, kind: str, process: subprocess.Popen[str]) -> Callable[[], None]:
        def act() -> None:
            if kind not in SIGNALS:
                strike(kind, self.stage, self.server, self.devices)
                return
            process.send_signal(SIGNALS[kind])
            if kind.startswith("SIGSTOP"):
                threading.Timer(3.0, lambda: process.send_signal(signal.SIGCONT)).start()

        return act

    def _samples(self, out: str) -> tuple[int, int]:
        wrong = kept = 0
        for log in (self.folder / out).rglob("*.mcap"):
            try:
                centers = read_log(log).trace.centers
            except Exception as error:  # a log without a sample: nothing was kept
                assert "none" in str(error) or "no " in str(error), error
                continue
            inside = (np.abs(centers[:, :2]) < np.array(HALF)).all(axis=1)
            wrong += int((np.abs(centers[inside, 2] - R) > OFF).sum())
            kept += len(centers)
        return wrong, kept


def _write_plate(path: Path) -> None:
    import trimesh

    surface = plate(*HALF)
    trimesh.Trimesh(surface.vertices, surface.faces, process=False).export(path)


@contextmanager
def bench(touch: str, seed: int = 0) -> Iterator[Bench]:
    folder = Path(tempfile.mkdtemp(prefix="machine-"))
    try:
        with Bench(folder, touch, seed) as made:
            yield made
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def broken(kind: str, run: Run) -> list[str]:
    """What does not hold of a run that was struck."""
    right = STATUS.get(kind, (0, 3) if kind in SURVIVABLE else (3,))
    stopped = run.status not in (0, -9)
    found = {
        "not struck": not run.struck,
        "force": run.strongest > MOST,
        "moved": run.moved > 0.0,
        "wrong samples": run.wrong > 0,
        "status": run.status not in right,
        "first line": stopped and not run.first,
        "traceback": "Traceback" in run.said,
    }
    return [name for name, true in found.items() if true]


def main(what: str, touches: tuple[str, ...], times: int) -> None:
    """Print what came of each case."""
    kinds = {
        "signals": tuple(SIGNALS),
        "faults": (*CONTROLLER_FAULTS, "port back", *BYTES),
    }
    held = made = 0
    for touch, number in itertools.product(touches, range(times)):
        cases = {
            "quiet": [("", "")],
            "resume": [("SIGKILL", "midway")],
            "signals": list(itertools.product(kinds["signals"], PHASES)),
            "faults": [
                (kind, PHASES[(i + number) % 3]) for i, kind in enumerate((*own_faults(touch), *kinds["faults"]))
            ],
        }[what]
        for kind, phase in cases:
            with bench(touch, number) as machine:
                run = machine.run(strike=(kind, phase) if kind else None)
                wrong = broken(kind, run) if kind else ["status"] * (run.status != 0) + ["wrong"] * (run.wrong > 0)
                times = f"{run.lasted if run.struck else 0.0:5.1f} s  status {run.status:4d}"
                case, samples = (touch, number, kind, phase), (run.wrong, run.kept)
                print(case_line(case, run.strongest, samples, times, wrong, run.first or run.last), flush=True)
                if what == "resume" or (kind == "SIGKILL" and run.struck):
                    again = machine.run("--resume")
                    bad = [each for each in broken("SIGSTOP 3 s", again) if each != "not struck"]
                    wrong += [f"resume: {each}" for each in bad]
                    case, samples = (touch, number, "resumed", ""), (again.wrong, again.kept)
                    times = f"        status {again.status:4d}"
                    print(case_line(case, again.strongest, samples, times, bad, again.last), flush=True)
                held, made = held + (not wrong), made + 1
    print(f"{held} of {made} held")


if __name__ == "__main__":
    fingers = (sys.argv[2],) if len(sys.argv) > 2 and sys.argv[2] != "all" else ("optoforce", "line", "peck")
    main(sys.argv[1], fingers, int(sys.argv[3]) if len(sys.argv) > 3 else 1)
