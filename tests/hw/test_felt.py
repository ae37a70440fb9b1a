"""What a finger returns is held against the move that asked for it, and against what the finger says of itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hw.felt import OUTSIDE_RADII, wrong_trace
from hw.finger import Workspace
from hw.move import Move
from mapping.trace import Trace

R = 5e-3
SPACE = Workspace(np.full(3, -0.2), np.full(3, 0.2), 0.1, 5.0)
MOVE = Move(np.array([[-0.05, 0.03, 0.02], [0.05, 0.03, 0.02]]), np.array([0.0, 0.0, -1.0]))
X, Y = np.linspace(-0.05, 0.05, 101), np.array([0.0, 1.0, 0.0])
FELT = Trace(X + 1.0, np.column_stack([X, 0 * X + 0.03, 0 * X + R]), np.zeros(101, dtype=np.int64), R)


def test_a_trace_of_its_move_is_right() -> None:
    assert wrong_trace(MOVE, FELT, SPACE) is None
    assert wrong_trace(MOVE, FELT.select(slice(0, 0)), SPACE) is None


@pytest.mark.parametrize(
    ("factor", "cause"), [(1e3, "in millimetres"), (1e6, "in micrometres"), (1 / 0.0254, "in inches")]
)
def test_a_forgotten_unit_is_named(factor: float, cause: str) -> None:
    wrong = wrong_trace(MOVE, replace(FELT, centers=factor * FELT.centers), SPACE)
    assert wrong is not None and f"{cause} instead of metres" in wrong and "possible are [-0.2, -0.2, -0.2]" in wrong


def test_another_frame_is_named() -> None:
    wrong = wrong_trace(MOVE, replace(FELT, centers=FELT.centers + 0.5 * Y), SPACE)
    assert wrong is not None and "another frame" in wrong and "101 of 101 samples outside, up to 330 mm" in wrong


def test_spikes_and_noise_at_the_border_stop_nothing() -> None:
    centers = FELT.centers.copy()
    centers[::3] += 10.0
    assert wrong_trace(MOVE, replace(FELT, centers=centers), SPACE) is None
    edge = FELT.centers + (0.17 + 0.9 * OUTSIDE_RADII * R) * Y
    assert wrong_trace(MOVE, replace(FELT, centers=edge), SPACE) is None
    assert wrong_trace(MOVE, replace(FELT, centers=edge + 0.2 * OUTSIDE_RADII * R * Y), SPACE) is not None


def test_times_may_stand_still_and_begin_anew_with_a_sweep_but_not_run_backwards() -> None:
    still = FELT.t.copy()
    still[5] = still[4]
    assert wrong_trace(MOVE, replace(FELT, t=still), SPACE) is None
    sweeps = np.repeat([0, 1], [50, 51])
    assert wrong_trace(MOVE, replace(FELT, t=np.append(FELT.t[:50], FELT.t[:51]), sweep=sweeps), SPACE) is None
    wrong = wrong_trace(MOVE, replace(FELT, t=FELT.t[::-1]), SPACE)
    assert wrong is not None and "100 of 101 samples lie before their predecessor" in wrong
    assert "sample 1 of sweep 0, 0.001 s before" in wrong
