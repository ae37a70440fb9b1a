"""A printer under Klipper as a finger: peck tracing with its Z probe, over Moonraker's HTTP API.

    [finger]
    kind = "klipper"
    url = "http://printer.local:7125"
    origin = ["100 mm", "100 mm", "2 mm"]

Klipper's PROBE runs down to stepper_z's position_min where it meets nothing: set that just below the object.
"""

from __future__ import annotations

import json
import time
from dataclasses import dataclass, field
from typing import Any, Literal
from urllib.error import HTTPError
from urllib.parse import urlencode
from urllib.request import Request, urlopen

import numpy as np

from explore3d.scene import FingerTable, Length, Point, Setting, Speed
from hw import Finger, FingerError, LinkError, Move, StoppedError, Workspace
from mapping import Trace


class KlipperTable(FingerTable):
    """The table [finger] of kind "klipper"; origin: where the object's origin stands on the machine."""

    kind: Literal["klipper"] = "klipper"
    url: str
    origin: Point
    step: Length = 5e-4
    clearance: Length = 1e-3
    probe_speed: Speed = 5e-3
    travel_speed: Speed = 0.05

    def finger(self, setting: Setting) -> Finger:
        """Entering it connects."""
        return KlipperFinger(self, setting.tip_radius, setting.armed)


@dataclass
class KlipperFinger:
    """Pecks straight down at every `step` of a sweep; records where the probe triggered."""

    table: KlipperTable
    tip_radius: float
    armed: bool
    patience: float = 3.0  # s without an answer
    _sweeps: int = field(init=False, default=0)
    _begun: float | None = field(init=False, default=None)
    _lost: str = field(init=False, default="")

    def __enter__(self) -> KlipperFinger:
        head = self._status("toolhead")
        if head["homed_axes"] != "xyz":
            raise StoppedError(f"{self.table.url}: home the printer first (G28); homed: {head['homed_axes']!r}")
        self._box = 1e-3 * np.array([head["axis_minimum"][:3], head["axis_maximum"][:3]]) - self.table.origin
        self._begun, self._lost = time.monotonic(), ""
        return self

    def __exit__(self, *ended: object) -> None:
        self._begun = None

    @property
    def workspace(self) -> Workspace:
        return Workspace(self._box[0], self._box[1], self.table.travel_speed, max_force=10.0)

    @property
    def info(self) -> dict[str, Any]:
        return {"kind": "klipper", "url": self.table.url, "step": self.table.step}

    def execute(self, move: Move) -> Trace:
        space, straight_down = self.workspace, np.allclose(move.approach, [0.0, 0.0, -1.0], atol=1e-6)
        if not self.armed or self._begun is None or self._lost:
            raise FingerError(self._lost or f"{self.table.url}: nothing moves without --arm and a connection")
        if (move.path < space.low).any() or (move.path > space.high).any():
            raise FingerError(f"the move leaves {space.low.tolist()} to {space.high.tolist()} m")
        if not straight_down or move.speed > space.max_speed or move.force > space.max_force:
            raise FingerError(f"it goes straight down, at most at {space.max_speed} m/s with {space.max_force} N")
        try:
            felt = self._carry_out(move)
        except FingerError as error:
            self._lost = str(error)
            raise
        times, centers = (np.array([row[k] for row in felt]) for k in (0, 1))
        return Trace(times, centers.reshape(-1, 3), np.full(len(felt), self._sweeps), self.tip_radius)

    def _carry_out(self, move: Move) -> list[tuple[float, np.ndarray]]:
        if move.purpose in ("travel", "retreat"):
            for point in move.path:
                self._go(point)
            return []
        self._sweeps += 1
        felt: list[tuple[float, np.ndarray]] = []
        along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(move.path, axis=0), axis=1)))
        for s in np.linspace(0.0, along[-1], 1 + round(along[-1] / self.table.step)):
            point = np.array([np.interp(s, along, move.path[:, k]) for k in range(3)])
            top = felt[-1][1][2] if felt else point[2] + self.tip_radius
            self._go(np.append(point[:2], max(top, point[2]) + self.table.clearance))
            self._script(f"PROBE PROBE_SPEED={1e3 * self.table.probe_speed:.3f} SAMPLES=1")
            height = self._status("probe")["last_z_result"]
            if not isinstance(height, float) or abs(self._status("toolhead")["position"][2] - height) > 0.1:
                self._stop(f"{self.table.url}: PROBE reports {height!r}, the head stands elsewhere: check the probe")
            contact = np.append(point[:2], 1e-3 * height - self.table.origin[2])
            felt.append((time.monotonic() - (self._begun or 0.0), contact))
            self._go(contact + np.array([0.0, 0.0, self.table.clearance]))
        return felt

    def _go(self, point: np.ndarray) -> None:
        x, y, z = 1e3 * (point + self.table.origin)
        self._script(f"G90\nG1 X{x:.4f} Y{y:.4f} Z{z:.4f} F{60e3 * self.table.travel_speed:.0f}\nM400")

    def _script(self, text: str) -> None:
        self._ask("POST", "/printer/gcode/script", script=text)

    def _status(self, name: str) -> dict[str, Any]:
        found: dict[str, Any] = self._ask("GET", f"/printer/objects/query?{name}")["status"][name]
        return found

    def _stop(self, why: str) -> None:
        try:
            urlopen(Request(f"{self.table.url}/printer/emergency_stop", method="POST"), timeout=1.0).close()
        except OSError:
            why += "; the emergency stop did not reach it either: look at the machine"
        raise StoppedError(why)

    def _ask(self, method: str, path: str, **query: str) -> Any:
        url = f"{self.table.url}{path}{'?' + urlencode(query) if query else ''}"
        try:
            with urlopen(Request(url, method=method), timeout=self.patience) as answer:
                return json.load(answer)["result"]
        except HTTPError as error:  # what Klipper itself says: shut down, not homed, no trigger on the probe
            said = " ".join(error.read().decode(errors="replace").split())
            raise StoppedError(f"{self.table.url}: {said}") from error
        except (OSError, ValueError, KeyError) as error:
            try:
                self._stop(f"{self.table.url}: no answer ({error}); check network and printer, home it, run again")
            except StoppedError as stopped:
                raise LinkError(str(stopped)) from error
