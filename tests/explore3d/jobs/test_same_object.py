"""A log of another object, or in another frame, is refused before anything is merged."""

from __future__ import annotations

import numpy as np
import pytest

from explore3d.jobs.merge import unlike
from explore3d.log.record import KIND, Event, Log, base_event
from mapping.base.base import Base
from mapping.surface import Surface
from mapping.trace import Trace

R = 5e-3


def plate(half: float = 0.05, height: float = 0.0) -> Base:
    corners = np.array([[-half, -half, height], [half, -half, height], [half, half, height], [-half, half, height]])
    return Base(Surface(corners, [[0, 1, 2], [0, 2, 3]]))


def log_over(base: Base | None, shift: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Log:
    """A sweep of 60 mm over a plate with a crest of 0.6 mm in its midst, moved by `shift`."""
    x = np.linspace(-0.03, 0.03, 4000)
    bump = np.maximum(0.0, 6e-4 - x**2 / (2.0 * R))
    centers = np.column_stack([x, np.zeros_like(x), R + bump + np.random.default_rng(0).normal(0.0, 1e-4, len(x))])
    trace = Trace(1e-3 * np.arange(len(x)), centers + np.array(shift), np.zeros(len(x), dtype=np.int64), R)
    events = () if base is None else (Event(KIND, 0.0, base_event(base)),)
    return Log(trace, events=events)


def test_a_later_log_of_the_same_object_is_taken() -> None:
    assert unlike(log_over(plate()), plate()) == ""
    assert unlike(log_over(None), plate()) == ""
    assert unlike(log_over(plate(0.049)), plate()) == ""  # a mesh cut elsewhere


@pytest.mark.parametrize("shift", [(0.0, 0.0, 2e-3), (0.0, 0.0, -2e-3), (0.0, 0.2, 0.0)])
def test_samples_off_the_base_are_another_object_or_frame(shift: tuple[float, float, float]) -> None:
    complaint = unlike(log_over(None, shift), plate())
    assert "half of its samples" in complaint and "0.5 mm is possible" in complaint


def test_a_log_recorded_for_another_mesh_is_another_object() -> None:
    assert "mesh that it was recorded for" in unlike(log_over(plate(height=3e-3)), plate())


def test_a_doubtful_pose_leaves_room() -> None:
    moved = log_over(None, (0.0, 0.0, 2e-3))
    assert unlike(moved, plate()) and unlike(moved, plate(), pose_sd=1e-3) == ""
