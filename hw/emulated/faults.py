"""Faults: what goes wrong on purpose between a driver and an emulated device."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

FAULT_KINDS = ("lose", "garble", "stall", "reset", "disconnect", "alarm")
BYTE_FAULTS = ("lose", "double", "garble")  # that strike every byte by chance, if they have a rate


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
        rate: chance of each byte to be lost, doubled or garbled (one bit flipped), from then on; 0: the next `count`.
    """

    kind: str
    at: float
    device: int = 0
    duration: float = 0.0
    count: int = 8
    incoming: bool = False
    seed: int = 0
    rate: float = 0.0
    _left: int = field(init=False)

    def __post_init__(self) -> None:
        if self.kind not in (FAULT_KINDS if self.rate == 0 else BYTE_FAULTS):
            raise ValueError(f"unknown fault {self.kind!r}; possible: {', '.join(FAULT_KINDS)}")
        self._left = self.count
        self._rng = np.random.default_rng(self.seed)

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
        if self.rate > 0:
            return self._by_chance(data), self._left
        count = min(self._left, len(data))
        self._left -= count
        if self.kind == "lose":
            return data[count:], self._left
        noise = np.random.default_rng((self.seed, self._left)).integers(1, 256, count, dtype=np.uint8)
        return bytes(np.frombuffer(data[:count], np.uint8) ^ noise) + data[count:], self._left

    def _by_chance(self, data: bytes) -> bytes:
        struck = self._rng.uniform(size=len(data)) < self.rate
        bits = 1 << self._rng.integers(0, 8, len(data))
        spoiled = bytearray()
        for byte, hit, bit in zip(data, struck, bits, strict=True):
            if not hit:
                spoiled.append(byte)
            elif self.kind == "double":
                spoiled += bytes((byte, byte))
            elif self.kind == "garble":
                spoiled.append(byte ^ int(bit))
        return bytes(spoiled)

    def act(self, device: Any) -> None:
        """Restart the device, or raise a hard-limit alarm in it."""
        if self.kind == "reset":
            device.power_up(locked=True)
        else:
            device.trip(1)
