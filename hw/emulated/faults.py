"""Faults: what goes wrong on purpose between a driver and an emulated device."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

FAULT_KINDS = ("lose", "garble", "stall", "reset", "disconnect", "alarm")


@dataclass
class Fault:
    """One fault.

    Args:
        kind: "lose" bytes, "garble" bytes, "stall" (silence), "reset" (the device restarts), "disconnect"
            (the port vanishes), "alarm" (a hard limit is hit).
        at: when, s after the server's start.
        device: which of the server's devices.
        duration: of a stall, or until the port comes back, s; a disconnect of duration 0 is for good.
        count: how many bytes are lost or garbled.
        incoming: True: bytes on their way to the device; False: on their way to the host.
        seed: of the garbling.
    """

    kind: str
    at: float
    device: int = 0
    duration: float = 0.0
    count: int = 8
    incoming: bool = False
    seed: int = 0
    _left: int = field(init=False)

    def __post_init__(self) -> None:
        if self.kind not in FAULT_KINDS:
            raise ValueError(f"unknown fault {self.kind!r}; possible: {', '.join(FAULT_KINDS)}")
        self._left = self.count

    @classmethod
    def random(cls, kind: str, rng: np.random.Generator, latest: float, device: int = 0) -> Fault:
        """A fault of that kind at a random moment before `latest`, s."""
        return cls(
            kind,
            at=float(rng.uniform(0.0, latest)),
            device=device,
            duration=float(rng.choice([0.2, 1.0, 5.0])),
            count=int(rng.integers(1, 60)),
            incoming=bool(rng.integers(2)),
            seed=int(rng.integers(2**31)),
        )

    def spoil(self, data: bytes) -> tuple[bytes, int]:
        """The bytes after the fault, and how many more it will spoil."""
        count = min(self._left, len(data))
        self._left -= count
        if self.kind == "lose":
            return data[count:], self._left
        noise = np.random.default_rng((self.seed, self._left)).integers(1, 256, count, dtype=np.uint8)
        return bytes(np.frombuffer(data[:count], np.uint8) ^ noise) + data[count:], self._left

    def act(self, device: Any) -> None:
        """Restart the device, or raise a hard-limit alarm in it."""
        if self.kind == "reset":
            device.power_up(locked=True)
        else:
            device.trip(1)
