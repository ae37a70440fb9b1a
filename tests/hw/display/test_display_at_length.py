"""A million random jumps, and hours of random motion: what a hand may do to a display in a working day."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from contact_bodies import shared

from explore3d.scene import load_mesh
from hw.display import DisplayLoop, Hand, Rendering, SimulatedDisplay
from mapping import FloatArray, Surface
from mapping.geometry.proxy import Bar, Bell, Chain, Part, ProxyBody, Terrace, Trench

MESHES = Path(__file__).parents[3] / "assets" / "meshes"
PLATE = Surface(0.03 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]), [[0, 1, 2], [0, 2, 3]])
UP = np.array([0.0, 0.0, 1.0])
BLOCK, MINUTES = 50_000, 60


def line(*places: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
    """An axis on the plate, through places in mm, and its normals."""
    axis = 1e-3 * np.array([[x, y, 0.0] for x, y in places])
    return axis, np.tile(UP, (len(axis), 1))


def every_kind() -> ProxyBody:
    """A plate with ridges, bars, a ring, round bumps, grooves, a pit and a step, some of which meet."""
    turn = np.linspace(0.0, 2.0 * np.pi, 61)
    ring = np.column_stack([6.0 * np.cos(turn) - 15.0, 6.0 * np.sin(turn) + 15.0])
    parts: list[Part] = [
        Chain(*line((-20, -20), (10, -15)), 0.6e-3, 0.4e-3),
        Chain(*line((-10, -25), (-5, -10)), 0.6e-3, 0.4e-3),
        Chain(*line(*map(tuple, ring)), 0.5e-3, 0.3e-3),
        Chain(*line((0, 0)), 0.8e-3, 0.4e-3),
        Chain(*line((-20, 0)), 0.2e-3, 2e-3),
        Bar(*line((-28, -10), (-15, -5), (-14, 5)), 0.4e-3, 1e-3, 0.3e-3),
        Bar(*line((-28, 10), (-26, -12)), 0.3e-3, 0.0, 0.8e-3),
        Trench(*line((0, 8), (18, 8)), 4e-3, 0.5e-3),
        Trench(*line((8, -2), (9, 20)), 2e-3, 0.8e-3),
        Trench(*line((20, 20)), 5e-3, 1e-3),
        Terrace(*line((15, -25), (15, -5)), 0.5e-3, -1.0),
    ]
    return ProxyBody(PLATE, parts, 2e-3)


def bell() -> ProxyBody:
    """A bump with a skirt, which bends towards the ball, in the middle of the plate."""
    return ProxyBody(PLATE, [Bell(np.zeros(3), UP, 1e-3, 1e-3, 2.0)], 2e-3)


def mug() -> ProxyBody:
    return ProxyBody(load_mesh(MESHES / "mug.ply"), (), 4e-3)


def bunny() -> ProxyBody:
    return ProxyBody(shared("bunny.off"), (), 4e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("build", "jumps"), [(every_kind, 300_000), (bell, 100_000), (mug, 300_000), (bunny, 300_000)])
def test_a_million_random_jumps_are_survived(build, jumps: int) -> None:  # type: ignore[no-untyped-def]
    """Finite, never above the force limit, never inside by more than 1e-9 r."""
    body, rng = build(), np.random.default_rng(2026)
    low, high = body.base.surface.bounds
    wide = high - low + 4.0 * body.radius
    # so stiff a hand has the light device wherever it wishes within each period
    hand = Hand(stiffness=1e6, damping=60.0, tremor=0.0)
    with SimulatedDisplay([high + body.radius], mass=1e-3, damping=1.0, max_force=3.0, hand=hand) as display:
        loop = DisplayLoop(display, body, Rendering(stiffness=1000.0))
        for _ in range(jumps // BLOCK):
            wishes = 0.5 * (low + high) + wide * rng.uniform(-0.6, 0.6, (BLOCK, 3))
            display.wish(wishes)
            run = loop.run(BLOCK, paced=False)
            assert run.reason == "done" and run.steps == BLOCK
            assert np.isfinite(run.records).all()
            # the device jumped: each place is one that was wished, but for what the force moves the hand
            apart = [run.records[1000:2000, 1:4] - wishes[1000 + late : 2000 + late] for late in (-1, 0, 1)]
            assert min(np.abs(each).max() for each in apart) < 10e-6
            assert body.gaps(run.centers, body.radius).min() > -1e-9 * body.radius
            assert np.linalg.norm(run.forces, axis=1).max() <= 3.0 * (1.0 + 1e-12)
            assert (run.column("touching") > 0).mean() > 0.1


@pytest.mark.slow
@pytest.mark.parametrize("build", [mug, bunny])
@pytest.mark.parametrize(("share", "controlled"), [(0.5, False), (1.5, True)])
def test_an_hour_of_random_motion_makes_no_energy(build, share: float, controlled: bool) -> None:  # type: ignore[no-untyped-def]
    """At half of Colgate's limit without the controller, at 1.5 times with it: the observer holds at least -1 uJ."""
    from scipy.signal import lfilter

    body, rng, rate, damping = build(), np.random.default_rng(7), 1000.0, 1.0
    low, high = body.base.surface.bounds
    keep = np.exp(-2.0 * np.pi * 0.4 / rate)  # a hand wanders at 0.4 Hz: twice filtered white noise
    filtered, memory = ([1.0 - keep], [1.0, -keep]), [np.zeros((1, 3)), np.zeros((1, 3))]
    least, touched, fastest = np.inf, 0.0, 0.0
    with SimulatedDisplay([high + body.radius], damping=damping, max_force=20.0, rate=rate) as display:
        loop = DisplayLoop(display, body, Rendering(stiffness=share * 2.0 * damping * rate, controlled=controlled))
        for _ in range(MINUTES):
            wander = rng.standard_normal((60_000, 3))
            for i in range(2):
                wander, memory[i] = lfilter(*filtered, wander, axis=0, zi=memory[i])
            deviation = np.sqrt((1.0 - keep) ** 4 * (1.0 + keep**2) / (1.0 - keep**2) ** 3)
            display.wish(0.5 * (low + high) + 0.4 * (high - low) * wander / deviation)
            run = loop.run(60_000, paced=False)
            assert run.steps == 60_000
            least = min(least, float(run.column("energy").min()))
            touched += float((run.column("touching") > 0).mean()) / MINUTES
            speed = np.linalg.norm(np.diff(run.records[:, 1:4], axis=0), axis=1).max() * rate
            fastest = max(fastest, float(speed))
    print(f"{build.__name__}, {share}: least energy {1e6 * least:.3g} uJ, touching {touched:.2f}, {fastest:.2f} m/s")
    assert least >= -1e-6
    assert touched > 0.1 and fastest > 0.5
