"""What lies on a detail says nothing against the model, however much of the path does; what is wider does."""

import numpy as np
import pytest

from mapping import FloatArray, Surface, Trace
from mapping.base import Base, LaidTrace
from mapping.estimate.deviation import explain
from mapping.estimate.deviation.blocks import Blocks
from mapping.estimate.deviation.on_details import unexplained

TIP = 1e-3
# The upper side of the plate, in single precision as a file of a mesh holds it
TOP = float(np.float32(6e-3))
RIB_HEIGHT, RIB_HALF_LENGTH = 0.4e-3, 10e-3


def plate() -> Base:
    u, v = np.linspace(-30e-3, 30e-3, 31), np.linspace(-20e-3, 20e-3, 21)
    flat = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
    i, j = (each.ravel() for each in np.meshgrid(np.arange(30), np.arange(20), indexing="ij"))
    a = 21 * i + j
    faces = np.concatenate([np.column_stack([a, a + 21, a + 22]), np.column_stack([a, a + 22, a + 1])])
    return Base(Surface(np.column_stack([flat, np.full(len(flat), TOP)]), faces))


def rib(points: FloatArray, width: float) -> FloatArray:
    """(N,) height of the ball's centre over the plate at (N, 2)."""
    beyond = np.maximum(np.abs(points) - [0.5 * width, RIB_HALF_LENGTH], 0.0)
    return np.maximum(RIB_HEIGHT - TIP + np.sqrt(np.maximum(TIP**2 - (beyond**2).sum(axis=1), 0.0)), 0.0)


def followed(seed: int, width: float, noise: float, passes: int = 90, margin: float = 4e-3) -> Trace:
    """Five pecked lines over a small region, and many passes along the whole rib that crosses it, at all slants."""
    rng = np.random.default_rng(seed)
    across = np.arange(-margin, margin, 0.33e-3)
    lines = [np.column_stack([across, np.full(len(across), v)]) for v in np.linspace(-2e-3, 2e-3, 5)]
    for place in rng.uniform(-RIB_HALF_LENGTH, RIB_HALF_LENGTH, passes):
        turn = rng.normal(0.0, 0.5) + (0.5 * np.pi if rng.random() < 0.15 else 0.0)
        s = rng.uniform(3e-3, 5e-3) * np.linspace(-0.5, 0.5, 25) + rng.normal(0.0, 0.5e-3)
        lines.append(np.column_stack([s * np.cos(turn), place + s * np.sin(turn)]))
    points = np.concatenate(lines)
    z = TOP + TIP + rib(points, width) + noise * rng.standard_normal(len(points))
    sweep = np.repeat(np.arange(len(lines)), [len(line) for line in lines])
    return Trace(0.5 * np.arange(len(points)), np.column_stack([points, z]), sweep, TIP)


@pytest.mark.parametrize("noise", [0.0, 2e-6])
@pytest.mark.parametrize("width", [1.0e-3, 1.5e-3])
@pytest.mark.parametrize("margin", [2.5e-3, 4e-3])
def test_a_rib_that_was_followed_is_no_fault_of_the_model(noise: float, width: float, margin: float) -> None:
    trace, base = followed(11, width, noise, margin=margin), plate()
    blocks = Blocks.of(LaidTrace.of(trace, base))
    assert np.average(np.abs(blocks.height) > 0.02 * TIP, weights=blocks.weight) > 0.6  # most of it lies on the rib
    assert explain(trace, base) is None


def lifted(rise: float) -> Trace:
    """The same plate without a rib, its model so much (m) too low."""
    trace = followed(12, 1e-3, 0.0, passes=0)
    flat = np.column_stack([trace.centers[:, :2], np.full(len(trace), TOP + TIP + rise)])
    return Trace(trace.t, flat, trace.sweep, TIP)


def test_a_level_is_on_no_detail_and_a_rib_is() -> None:
    base, within = plate(), 0.02 * TIP
    level = Blocks.of(LaidTrace.of(lifted(0.4e-3), base))
    assert unexplained(level, level.height, within, TIP) == 1.0
    felt = Blocks.of(LaidTrace.of(followed(13, 1e-3, 0.0, passes=0), base))
    assert (np.abs(felt.height) > within).any()
    assert unexplained(felt, felt.height, within, TIP) == 0.0


def test_what_stands_off_over_a_rough_surface_is_narrow() -> None:
    trace = lifted(0.0)
    rough = trace.centers + np.outer(0.1e-3 * np.sin(2.0 * np.pi * trace.centers[:, 0] / 1.5e-3), [0.0, 0.0, 1.0])
    blocks = Blocks.of(LaidTrace.of(Trace(trace.t, rough, trace.sweep, TIP), plate()))
    assert (np.abs(blocks.height) > 0.02 * TIP).mean() > 0.5
    assert unexplained(blocks, blocks.height, 0.02 * TIP, TIP) < 0.5


def test_single_precision_of_a_mesh_is_no_deviation() -> None:
    assert explain(lifted(0.4 * (TOP - 6e-3)), plate()) is None
