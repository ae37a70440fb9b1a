"""All that was felt lies off its model by one amount: that is named with its sign, and corrected while the ball's own
width bounds it; a log of few samples is no exception."""

import numpy as np
import pytest

from mapping import Surface, Trace
from mapping.base import Base, LaidTrace
from mapping.detection import detect
from mapping.estimate.deviation import explain
from mapping.estimate.deviation.blocks import Blocks

TIP, NOISE = 1e-3, 2e-6
# A point every quarter of a tip radius: a CNC machine that probes
STEP = 0.25e-3
RIB_HEIGHT, RIB_WIDTH = 0.3e-3, 0.6e-3
# The model's plate: 40 x 30 mm and 4 mm thick, its upper side at z = 0
LOW, HIGH = np.array([-8e-3, -7e-3, -4e-3]), np.array([32e-3, 23e-3, 0.0])


def plate(rise: float = 0.0) -> Base:
    """The model, lifted by so much (m) against where the plate stands."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=np.float64)
    faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6],
             [0, 6, 4], [1, 5, 7], [1, 7, 3]]  # fmt: skip
    vertices = LOW + corners * (HIGH - LOW) + [0.0, 0.0, rise]
    return Base(Surface(vertices, np.array(faces)))


def probed(rib: float = RIB_HEIGHT, seed: int = 41) -> Trace:
    """24 rows over the plate with a rib (m high) across them, as single points."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(0.0, 24.1e-3, STEP), np.linspace(0.0, 16e-3, 24))
    beside = np.maximum(np.abs(x - 11.1e-3) - 0.5 * RIB_WIDTH, 0.0)
    z = TIP + np.maximum(rib - TIP + np.sqrt(np.maximum(TIP**2 - beside**2, 0.0)), 0.0)
    z = z + NOISE * rng.standard_normal(x.shape)
    centers = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    sweep = np.repeat(np.arange(len(x)), x.shape[1])
    return Trace(np.arange(float(len(centers))), centers, sweep, TIP)


def test_samples_wider_apart_than_bins_have_their_noise() -> None:
    blocks = Blocks.of(LaidTrace.of(probed(rib=0.0), plate()))
    # two samples in a block of half a tip radius, two thousandths of one each
    assert blocks.noise == pytest.approx(NOISE / np.sqrt(2.0), rel=0.15)
    assert blocks.smooth(blocks.height).mean() > 0.9


def test_a_right_model_under_few_samples_is_left_alone() -> None:
    assert explain(probed(), plate()) is None


@pytest.mark.parametrize(
    "rise", [-1.0e-3, 0.2e-3, *(pytest.param(1e-3 * mm, marks=pytest.mark.slow) for mm in (-0.3, -0.2, 0.3, 1.0))]
)
def test_a_common_level_is_named_and_corrected_either_way(rise: float) -> None:
    trace, base = probed(), plate(rise)
    found = explain(trace, base)
    assert found is not None
    assert not found.beyond_repair
    assert not found.parts
    assert found.causes[0] in ("offset", "pose")  # over one plane a shift and an offset are the same
    assert found.shift[2] + found.offset == pytest.approx(-rise, abs=2e-6)
    # what the report's map shows is what was taken off
    top = base.surface.vertices[:, 2] > base.surface.vertices[:, 2].mean()
    assert np.median(found.heights[top]) == pytest.approx(-rise, abs=5e-6)
    crossings = detect(LaidTrace.of(trace, found.base), found.base).crossings
    ribs = [c for c in crossings if c.height == pytest.approx(RIB_HEIGHT, rel=0.1)]
    assert len({c.sweep for c in ribs}) == 24


@pytest.mark.parametrize(("rise", "level", "facing"), [(-10e-3, 10e-3, 1.0), (10e-3, 4e-3, -1.0)])
def test_further_than_the_ball_is_wide_nothing_is_looked_for(rise: float, level: float, facing: float) -> None:
    # under a model 10 mm too high the ball is next to the lower side, 4 mm from touching it
    found = explain(probed(), plate(rise))
    assert found is not None
    assert found.beyond_repair
    assert found.causes == ("offset",)
    assert found.offset == pytest.approx(level, abs=5e-6)
    assert found.facing == pytest.approx([0.0, 0.0, facing])
    sentence = found.sentence()
    assert f"{1e3 * level:g} mm" in sentence
    assert f"faces (0, 0, {facing:g})" in sentence
    assert "not taken off" in sentence
    assert "nothing was looked for" in sentence
