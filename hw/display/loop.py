"""DisplayLoop: a device, a body, and a compiled loop between them in a thread of its own."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hw import FingerError
from hw.display.device import Display
from mapping import FloatArray
from mapping.geometry.proxy import ProxyBody, free_place

# Seconds of records that the ring holds: the reader comes by far more often
RING_TIME = 2.0
# Seconds between two looks of the reader at the ring, and of the guard at the loop
LOOK_PERIOD, GUARD_PERIOD = 0.05, 1e-3
# Seconds after which a loop that makes no step is stuck in its device
STUCK_TIME = 4e-3
# Columns of a run's records
RECORD_FIELDS = (
    "t", "x", "y", "z", "px", "py", "pz", "fx", "fy", "fz", "touching", "late", "computing", "energy",
)  # fmt: skip
REASONS = {
    1: "done",
    2: "the device is silent: no sample for 4 ms",
    3: "the device is frozen: its position did not change for 4 ms",
    4: "the device was lost",
    5: "stopped",
    6: "the device hung: no step for 4 ms",
}


@dataclass(frozen=True)
class Rendering:
    """How a body feels.

    Args:
        stiffness: of the spring between device and proxy, N/m.
        friction: coefficient.
        damping: virtual, N s/m, while it touches.
        controlled: True bounds the force so that no energy can be made; the observer always runs.
        scale: metres on the body for each metre of the device.
        origin: (3,) place on the body where the device's origin is, m.
    """

    stiffness: float = 500.0
    friction: float = 0.0
    damping: float = 0.0
    controlled: bool = True
    scale: float = 1.0
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name, least in (("stiffness", 0.0), ("scale", 0.0), ("friction", -1e-300), ("damping", -1e-300)):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > least):
                wanted = "positive" if least == 0.0 else "at least 0"
                raise FingerError(f"a rendering's {name} must be {wanted} and finite; found {value!r}")


@dataclass(frozen=True, eq=False)
class Run:
    """What came of a run.

    Args:
        records: (N, 14) `RECORD_FIELDS` of each step: s, m and N; places on the body, forces of the device; lateness
            and computing time of the step, s; energy that the observer holds for the hand's, J: below 0 it was made.
        reason: why it ended.
        steps: how many steps were made.
        lost: records that came too fast to be kept.
    """

    records: FloatArray
    reason: str
    steps: int
    lost: int

    def column(self, name: str) -> FloatArray:
        """(N,) one of `RECORD_FIELDS`."""
        return np.asarray(self.records[:, RECORD_FIELDS.index(name)])

    @property
    def centers(self) -> FloatArray:
        """(N, 3) centres of the proxy, m, on the body."""
        return np.asarray(self.records[:, 4:7])

    @property
    def forces(self) -> FloatArray:
        """(N, 3) forces on the hand, N."""
        return np.asarray(self.records[:, 7:10])


@dataclass(eq=False)
class DisplayLoop:
    """The loop between a device that is open and a body.

    Args:
        display: the device.
        body: what is felt.
        rendering: how.

    Raises:
        FingerError: the first sample does not come, this system has no clock that compiled code can read, or the device
            states no damping: then no force is passive, and the controller would allow none.
    """

    display: Display
    body: ProxyBody
    rendering: Rendering = Rendering()
    _state: FloatArray | None = field(init=False, default=None)

    @property
    def passive_stiffness(self) -> float:
        """Colgate's limit 2 b / T of the device's damping and rate, N/m: below it no energy can be made."""
        return 2.0 * self.display.damping * self.display.rate

    def run(
        self, steps: int, *, paced: bool = True, keep: bool = True, look: Callable[[FloatArray], bool] | None = None
    ) -> Run:
        """Let the hand feel the body for so many steps.

        Args:
            steps: at most.
            paced: True keeps to the clock, in a thread; False runs as fast as it can, for simulated devices.
            keep: True keeps all records, else only the newest `RING_TIME` of them.
            look: is shown new records (n, 14) some times a second; returns True to stop.

        Raises:
            FingerError: see above. Ctrl-C ends a paced run as `look` does.
        """
        if steps < 1:
            raise FingerError(f"a display runs at least one step; found {steps}")
        calls, kernel, given = self._begin()
        control = np.zeros(4, dtype=np.int64)
        period = 1.0 / self.display.rate
        ring = np.zeros((max(int(RING_TIME * self.display.rate), 1000), len(RECORD_FIELDS)))
        kept: list[FloatArray] = []
        if not paced:
            lost = 0
            while control[1] < steps and control[2] in (0, 1):
                some = min(steps - int(control[1]), len(ring))
                before = int(control[3])
                kernel(*given, False, period, some, control, self._state, ring)
                fresh = self._between(ring, before, int(control[3]))
                if not keep:
                    kept.clear()
                kept.append(fresh)
                if look is not None and look(fresh):
                    break
            return self._ended(control, kept, lost)
        worker = threading.Thread(
            target=kernel, args=(*given, True, period, steps, control, self._state, ring), name="display", daemon=True
        )
        lost, seen = 0, 0
        guard = threading.Thread(target=self._guard, args=(control, worker, calls), name="guard", daemon=True)
        worker.start()
        if not calls.returns:
            guard.start()
        try:
            alive = True
            while alive:
                alive, now = worker.is_alive(), int(control[3])
                if now > seen:
                    # what is being written over meanwhile is not read
                    oldest = max(seen, now - (int(0.9 * len(ring)) if alive else len(ring)))
                    lost += oldest - seen
                    fresh = self._between(ring, oldest, now)
                    seen = now
                    if not keep:
                        kept.clear()
                    kept.append(fresh)
                    if look is not None and look(fresh):
                        control[0] = control[0] or 1
                if alive:
                    try:
                        time.sleep(LOOK_PERIOD)
                    except KeyboardInterrupt:
                        control[0] = control[0] or 1
        finally:
            control[0] = control[0] or 1
            worker.join(timeout=1.0)
        return self._ended(control, kept, lost)

    def _begin(self) -> tuple[Any, Any, tuple[Any, ...]]:
        from hw.display import loop_kernels, pointer_kernels

        if self.rendering.controlled and not self.display.damping > 0.0:
            name = self.display.info.get("kind", "")
            raise FingerError(
                f"the display {name} states a damping of {self.display.damping} N s/m: then no force is passive; "
                "state what its mechanism has, or hand in Rendering(controlled=False)"
            )
        calls, look = self.display.calls(), self.rendering
        try:
            clock, sleep = pointer_kernels.clock_function(), pointer_kernels.sleep_function()
        except AttributeError as error:
            raise FingerError(f"this system's C library has no {error}: displays run on Linux and macOS") from error
        scale = self.body.scale
        origin = np.asarray(look.origin, dtype=np.float64)
        shift = self.body.into(origin[None])[0]
        frame = np.array([look.scale * scale, *shift, 1.0 / (look.scale * scale)])
        if self._state is None:
            first = self._first(calls, pointer_kernels)
            self._state = np.zeros(12)
            place = look.scale * first + origin
            self._state[0:3] = self.body.into(free_place(self.body, place)[None])[0]
            self._state[3:6] = self.body.into(place[None])[0]
        given = (
            self.body.arrays, scale * self.body.radius, frame, look.friction, look.stiffness, look.damping,
            look.controlled, self.display.damping, self.display.max_force,
            self.display.resolution == 0.0, calls.returns,
            pointer_kernels.Function(calls.read), pointer_kernels.Function(calls.write), calls.state, clock, sleep,
        )  # fmt: skip
        return calls, loop_kernels.run_loop, given

    def _first(self, calls: Any, pointer_kernels: Any) -> FloatArray:
        """The device's first sample, for which it has a second."""
        place = np.zeros(3)
        begin = time.monotonic()
        while time.monotonic() - begin < 1.0:
            answer = _call(calls.read, calls.state, place)
            if answer == 0 and np.isfinite(place).all():
                return place
            if answer < 0:
                break
            time.sleep(GUARD_PERIOD)
        raise FingerError(f"the display {self.display.info.get('kind', '')} gives no sample; is it plugged in and on?")

    def _guard(self, control: Any, worker: threading.Thread, calls: Any) -> None:
        """Write zero for a loop that hangs in its device's `read`."""
        seen, since = -1, time.monotonic()
        while worker.is_alive():
            now, done = time.monotonic(), int(control[1])
            if done != seen:
                seen, since = done, now
            elif done > 0 and now - since > STUCK_TIME and control[0] == 0:
                control[0] = 2
                _call(calls.write, calls.state, np.zeros(3))
            time.sleep(GUARD_PERIOD)

    def _between(self, ring: FloatArray, first: int, end: int) -> FloatArray:
        """Records number `first` to before `end` of a ring, places in m."""
        records = ring[np.arange(first, end) % len(ring)]
        records[:, 1:4], records[:, 4:7] = self.body.out(records[:, 1:4]), self.body.out(records[:, 4:7])
        return np.asarray(records)

    def _ended(self, control: Any, kept: list[FloatArray], lost: int) -> Run:
        records = np.concatenate(kept) if kept else np.zeros((0, len(RECORD_FIELDS)))
        return Run(records, REASONS.get(int(control[2]), "stopped"), int(control[1]), lost)


def _call(address: int, state: int, place: FloatArray) -> int:
    """One of a device's functions, from Python."""
    from ctypes import CFUNCTYPE, c_int32, c_int64

    return int(CFUNCTYPE(c_int32, c_int64, c_int64)(address)(state, place.ctypes.data))
