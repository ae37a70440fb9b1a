"""SimulatedDisplay: a device without hardware, in a hand without a person."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import TracebackType
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from hw import FingerError
from hw.display.device import Calls
from mapping import FloatArray

DEVICE_FAULTS = ("silent", "frozen", "unplugged")


@dataclass(frozen=True)
class Hand:
    """A hand that follows where it wishes to be, by its grip.

    Args:
        stiffness: of the grip, N/m.
        damping: of the grip, N s/m.
        tremor: amplitude of where it wishes to be, m: no hand is ever quite still.
        tremor_rate: Hz.

    The defaults are of the order of a light precision grip (Hajian and Howe, J. Biomech. Eng. 119, 1997) and of
    physiological tremor.
    """

    stiffness: float = 400.0
    damping: float = 3.0
    tremor: float = 10e-6
    tremor_rate: float = 9.0


@dataclass(eq=False)
class SimulatedDisplay:
    """A mass with damping, moved by a hand along places, exactly: each period is one step of the closed form.

    Args:
        wishes: (N, 3) where the hand wishes to be in each period, m; after the last it stays there.
        rate: steps per second.
        mass: of the device and what of the hand moves with it, kg.
        damping: of the device, N s/m.
        max_force: N.
        hand: its grip.
        fault: what fails at `fault_time` seconds: "silent", "frozen", "unplugged"; None: nothing.

    Raises:
        FingerError: sizes that no device has.
    """

    wishes: ArrayLike
    rate: float = 1000.0
    mass: float = 0.1
    damping: float = 1.0
    max_force: float = 3.0
    hand: Hand = Hand()
    fault: Literal["silent", "frozen", "unplugged"] | None = None
    fault_time: float = 0.0
    resolution: float = field(default=0.0, init=False)

    def __post_init__(self) -> None:
        places = np.ascontiguousarray(self.wishes, dtype=np.float64)
        if places.ndim != 2 or places.shape[1] != 3 or len(places) == 0 or not np.isfinite(places).all():
            raise FingerError(f"a hand's places must be finite, of shape (N, 3), N >= 1; found shape {places.shape}")
        for name in ("rate", "mass", "max_force"):
            if not 0 < getattr(self, name) < np.inf:
                raise FingerError(f"a simulated display's {name} must be positive; found {getattr(self, name)!r}")
        if not (0 <= self.damping < np.inf and 0 <= self.hand.stiffness < np.inf and 0 <= self.hand.damping < np.inf):
            raise FingerError("damping and grip of a simulated display must be at least 0 and finite")
        if self.fault is not None and self.fault not in DEVICE_FAULTS:
            raise FingerError(f"unknown fault {self.fault!r}; possible: {', '.join(DEVICE_FAULTS)}")
        self._state = self._begin(places)

    @property
    def info(self) -> dict[str, Any]:
        """Kind and mechanics, SI units."""
        return {
            "kind": "simulated", "rate": self.rate, "mass": self.mass, "damping": self.damping,
            "grip_stiffness": self.hand.stiffness, "grip_damping": self.hand.damping,
        }  # fmt: skip

    @property
    def position(self) -> FloatArray:
        """(3,) where the device is now, m."""
        return self._state[4:7].copy()

    def wish(self, places: ArrayLike) -> None:
        """New places (N, 3), m, that the hand follows from now on; the device goes on from where it is."""
        fresh = np.ascontiguousarray(places, dtype=np.float64)
        header = self._state[:32].copy()
        header[0], header[1] = 0.0, len(fresh)
        self._state = np.concatenate([header, fresh.ravel()])

    def calls(self) -> Calls:
        from hw.display import pointer_kernels

        return Calls(
            pointer_kernels.read_simulated.address,
            pointer_kernels.write_simulated.address,
            self._state.ctypes.data,
            self._state,
            returns=True,
        )

    def __enter__(self) -> SimulatedDisplay:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        self._state[10:13] = 0.0

    def _begin(self, places: FloatArray) -> FloatArray:
        from scipy.linalg import expm

        header = np.zeros(32)
        header[1] = len(places)
        header[2] = 0.0 if self.fault is None else 1.0 + DEVICE_FAULTS.index(self.fault)
        header[3] = self.fault_time * self.rate
        header[4:7] = places[0]
        stiffness, damping = self.hand.stiffness, self.hand.damping + self.damping
        system = np.zeros((3, 3))
        system[0, 1] = 1.0
        system[1] = -stiffness / self.mass, -damping / self.mass, 1.0 / self.mass
        step = expm(system / self.rate)  # the force held over the period is a third, constant, state
        header[13:19] = step[0, 0], step[0, 1], step[1, 0], step[1, 1], step[0, 2], step[1, 2]
        header[19] = stiffness
        header[20], header[21] = self.hand.tremor, 2.0 * np.pi * self.hand.tremor_rate / self.rate
        return np.concatenate([header, places.ravel()])
