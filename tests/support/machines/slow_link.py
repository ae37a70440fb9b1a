"""Slides of 4 mm over a plate, over links of some latency: what they cost and are worth.

Run by itself it prints one line a case: PYTHONPATH=. python tests/support/machines/slow_link.py [latencies, ms]
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np
from struck_machine import BAUD, DOWN, FRAME, STIFFNESS, R, machine_over, plate

from hw.emulated.force import OptoForceEmulator
from hw.emulated.grbl import GrblEmulator
from hw.emulated.pty_server import PtyServer
from hw.emulated.wire import Wire
from hw.move import Move
from hw.probing.grbl_finger import GrblFinger
from hw.probing.slide import Slide
from hw.sensors.optoforce import OptoForce

USB_TIMER = 0.016


@dataclass(frozen=True)
class Slid:
    """Seconds from first to last sample, rms off the plate and largest (m), largest true force (N), samples."""

    seconds: float
    rms: float
    worst: float
    strongest: float
    samples: int


class Watcher:
    """Sees the true force."""

    def __init__(self, stage: GrblEmulator) -> None:
        self.out = bytearray()
        self.stage, self.strongest = stage, 0.0

    def receive(self, data: bytes, now: float) -> None: ...

    def advance(self, now: float) -> None:
        self.stage.advance(now)
        z = FRAME.to_object(self.stage.motion.position)[2]
        self.strongest = max(self.strongest, STIFFNESS * max(0.0, R - z))


def slid(latency: float, timer: float = 0.0, speed: float = 0.01, sweeps: int = 3, period: float = 0.01) -> list[Slid]:
    """Each of some sweeps of 4 mm."""
    stage = machine_over(plate(), 0.006)
    watcher = Watcher(stage)
    sensor = OptoForceEmulator(stage, noise=0.003)
    found = []
    with PtyServer([stage, watcher, sensor], wires={0: Wire(BAUD, latency, timer)}) as server:
        slide = Slide(OptoForce(server.ports[2], 400.0), STIFFNESS, approach_speed=5e-3, reach=R, period=period)
        safe = {"armed": True, "position_known": True, "over_travel": 4e-4, "surface": plate()}
        with GrblFinger(port=server.ports[0], tip_radius=R, frame=FRAME, slide=slide, **safe) as finger:
            for number in range(sweeps):
                watcher.strongest = 0.0
                y = 1e-3 * number
                path = np.array([[-2e-3, y, 0.98 * R], [2e-3, y, 0.98 * R]])
                trace = finger.execute(Move(path, DOWN, speed=speed, force=1.0))
                off = trace.centers[:, 2] - R
                seconds = float(np.ptp(trace.t)) if len(trace) else np.inf
                rms = float(np.sqrt(np.mean(off**2))) if len(trace) else np.inf
                worst = float(np.abs(off).max()) if len(trace) else np.inf
                found.append(Slid(seconds, rms, worst, watcher.strongest, len(trace)))
    assert server.error is None, server.error
    return found


if __name__ == "__main__":
    for latency in (float(word) * 1e-3 for word in sys.argv[1:] or ("0", "5", "12", "20")):
        for timer in (0.0, USB_TIMER):
            for each in slid(latency, timer):
                print(
                    f"{1e3 * latency:4.0f} ms, timer {1e3 * timer:2.0f} ms: {each.seconds:5.2f} s, rms "
                    f"{1e6 * each.rms:5.2f} um, worst {1e6 * each.worst:5.1f} um, peak {each.strongest:4.2f} N, "
                    f"{each.samples} samples",
                    flush=True,
                )
