"""The conformance suite of explore3d on this finger: python -m pytest examples/klipper"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from explore3d.testing import CASES, Rig, check
from hw import Move

sys.path.insert(0, str(Path(__file__).parent))
from explore3d_klipper import KlipperFinger, KlipperTable
from fake_moonraker import FakePrinter

ORIGIN, TIP = np.array([0.1, 0.1, 0.02]), 5e-3


def height(x: float, y: float) -> float:
    """Of the tip's centre: a plate in the object's plane z = 0, and a round hill 2 mm high."""
    return float(ORIGIN[2] + TIP + 2e-3 * np.exp(-((x - ORIGIN[0]) ** 2 + (y - ORIGIN[1]) ** 2) / (2 * 0.01**2)))


@contextmanager
def rig() -> Iterator[Rig]:
    with FakePrinter(height, pace=10.0) as printer:
        table = KlipperTable(kind="klipper", url=printer.url, origin=tuple(ORIGIN))

        def off(centers: np.ndarray) -> np.ndarray:
            return np.array([z + ORIGIN[2] - height(x + ORIGIN[0], y + ORIGIN[1]) for x, y, z in centers])

        def restart() -> None:
            printer.homed = ""

        yield Rig(
            open=lambda: KlipperFinger(table, TIP, armed=True, patience=1.0),
            sweep=Move(np.array([[-4e-3, 0.0, TIP], [4e-3, 0.0, TIP]]), np.array([0.0, 0.0, -1.0]), speed=0.01),
            off=off,
            tolerance=1e-6,
            travelled=lambda: printer.travelled,
            faults={
                "gone": printer.vanish,
                "silent": lambda: setattr(printer, "silent", True),
                "stopped": lambda: setattr(printer, "shut_down", "Shutdown due to M112 command"),
                "restarted": restart,
                "garbled": lambda: setattr(printer, "nonsense", True),
            },
        )


@pytest.mark.parametrize("case", CASES)
def test_it_conforms(case: str) -> None:
    if not check(case, rig):
        pytest.skip("the fake printer has no such fault")
