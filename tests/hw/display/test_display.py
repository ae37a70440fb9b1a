"""The display's loop: what it makes a simulated hand feel, that it makes no energy, and how it ends."""

from __future__ import annotations

import time

import numpy as np
import pytest

from hw import FingerError
from hw.display import Calls, Display, DisplayLoop, Hand, Rendering, SimulatedDisplay, loop as loop_module, python_calls
from mapping import FloatArray, Surface
from mapping.geometry.proxy import ProxyBody

PLATE = Surface(0.05 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]), [[0, 1, 2], [0, 2, 3]])
R = 5e-3


def pressed(depth: float, steps: int = 4000) -> FloatArray:
    """A hand that comes down from 2 mm above the plate to a depth below it, within a second, and stays."""
    z = R + np.interp(np.arange(steps), [0, 1000], [2e-3, -depth])
    return np.column_stack([np.zeros(steps), np.zeros(steps), z])


def test_the_simulated_display_keeps_to_the_contract() -> None:
    assert isinstance(SimulatedDisplay(pressed(1e-3)), Display)


@pytest.mark.slow
def test_a_pressing_hand_is_held_by_springs_in_series() -> None:
    display = SimulatedDisplay(pressed(2e-3), hand=Hand(stiffness=400.0), max_force=5.0)
    with display:
        run = DisplayLoop(display, ProxyBody(PLATE, (), R), Rendering(stiffness=600.0)).run(3990, paced=False)
    assert run.reason == "done" and run.steps == 3990
    assert abs(run.forces[-1000:, 2].mean() - 2e-3 * 400.0 * 600.0 / 1000.0) < 1e-3
    assert np.abs(run.centers[-1000:, 2] - R).max() < 1e-9


def test_the_force_never_exceeds_the_limit() -> None:
    wishes = R + 0.02 * np.random.default_rng(1).standard_normal((4000, 3))
    with SimulatedDisplay(wishes, max_force=1.5) as display:
        run = DisplayLoop(display, ProxyBody(PLATE, (), R), Rendering(stiffness=5000.0)).run(4000, paced=False)
    assert np.linalg.norm(run.forces, axis=1).max() <= 1.5


@pytest.mark.parametrize(("fault", "reason"), [("silent", "silent"), ("frozen", "frozen"), ("unplugged", "lost")])
def test_a_device_that_fails_is_let_go_of_within_5_ms(fault: str, reason: str) -> None:
    display = SimulatedDisplay(pressed(1e-3), fault=fault, fault_time=2.0)  # type: ignore[arg-type]
    with display:
        run = DisplayLoop(display, ProxyBody(PLATE, (), R)).run(4000, paced=False)
        assert not display._state[10:13].any()  # the force that the device holds
    assert reason in run.reason
    assert run.column("t")[-1] + 1e-3 - 2.0 <= 5e-3 + 1e-9


def wall_energy(stiffness: float, rate: float, controlled: bool = False) -> float:
    """Least energy that a wall holds for a hand that shakes into it at the highest rate that a sampled wall sees."""
    steps = 2000
    body = ProxyBody(PLATE, (), R)
    places = np.zeros((steps, 3))
    places[:, 2] = R - 1e-3 + 20e-6 * (-1.0) ** np.arange(steps)
    places[:10, 2] = R + np.linspace(1e-3, -1e-3, 10)
    places[-10:, 2] = R + np.linspace(-1e-3, 1e-3, 10)
    at = iter(places)
    device = Led(lambda: next(at), rate, damping=1.0)
    run = DisplayLoop(device, body, Rendering(stiffness=stiffness, controlled=controlled)).run(steps - 2, paced=False)
    force, x = run.forces[:, 2], run.column("z")
    made = -(force[:-1] * np.diff(x)).sum() + 1.0 * (np.diff(x)[11:-11] ** 2).sum() * rate
    return float(made)


class Led:
    """A device that is moved by force majeure along given places."""

    max_force, resolution = 100.0, 1e-9

    def __init__(self, read, rate: float, damping: float) -> None:  # type: ignore[no-untyped-def]
        self._read, self.rate, self.damping = read, rate, damping
        self.forces: list[FloatArray] = []
        self.info = {"kind": "led"}
        self._calls = python_calls(read, self.forces.append)

    def calls(self) -> Calls:
        return self._calls


@pytest.mark.parametrize("rate", [1000.0, 5000.0])
def test_colgates_limit_is_where_a_wall_begins_to_make_energy(rate: float) -> None:
    low, high = 0.2 * 2.0 * rate, 3.0 * 2.0 * rate
    assert wall_energy(low, rate) > 0.0 > wall_energy(high, rate)
    for _ in range(8):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if wall_energy(middle, rate) > 0.0 else (low, middle)
    assert abs(0.5 * (low + high) / (2.0 * rate) - 1.0) < 0.25


def test_below_colgates_limit_no_random_motion_makes_energy() -> None:
    rng = np.random.default_rng(2)
    wishes = R + np.cumsum(rng.standard_normal((60_000, 3)), axis=0) * 20e-6
    wishes -= np.linspace(0, 1, len(wishes))[:, None] * (wishes[-1] - wishes[0])
    with SimulatedDisplay(wishes, damping=1.0, max_force=5.0) as display:
        loop = DisplayLoop(display, ProxyBody(PLATE, (), R), Rendering(stiffness=1000.0, controlled=False))
        assert loop.passive_stiffness == 2000.0
        run = loop.run(60_000, paced=False)
    assert (run.column("touching") > 0).mean() > 0.1
    assert run.column("energy").min() > -1e-9


@pytest.mark.parametrize("share", [1.5, 10.0])
def test_above_the_limit_the_controller_lets_no_energy_be_made(share: float) -> None:
    rng = np.random.default_rng(4)
    wishes = np.zeros((20_000, 3))
    wishes[:, 2] = R + 1e-3 + np.cumsum(rng.standard_normal(20_000)) * 30e-6
    wishes[:, 2] = R + np.abs(wishes[:, 2] - R) * np.sign(np.sin(np.arange(20_000) / 700.0))
    least = []
    for controlled in (True, False):
        with SimulatedDisplay(wishes, damping=1.0, max_force=50.0) as display:
            look = Rendering(stiffness=share * 2000.0, controlled=controlled)
            run = DisplayLoop(display, ProxyBody(PLATE, (), R), look).run(20_000, paced=False)
        assert (run.column("touching") > 0).mean() > 0.1
        least.append(run.column("energy").min())
    assert least[0] > -1e-12 and least[1] < -1e-9


def test_below_the_limit_the_controller_changes_nothing() -> None:
    felt = []
    for controlled in (True, False):
        with SimulatedDisplay(pressed(2e-3), damping=1.0) as display:
            look = Rendering(stiffness=1000.0, controlled=controlled)
            felt.append(DisplayLoop(display, ProxyBody(PLATE, (), R), look).run(3000, paced=False).forces)
    assert np.allclose(felt[0], felt[1], atol=1e-9)


def test_a_device_without_damping_is_refused() -> None:
    with pytest.raises(FingerError, match=r"no force is passive.*controlled=False"):
        DisplayLoop(SimulatedDisplay(pressed(1e-3), damping=0.0), ProxyBody(PLATE, (), R)).run(10, paced=False)


def test_a_hand_that_begins_inside_is_not_thrown_out() -> None:
    wishes = np.zeros((3000, 3))
    wishes[:, 2] = R + np.interp(np.arange(3000), [0, 1000, 2000, 3000], [-1e-3, -1e-3, 1e-3, -1e-3])
    with SimulatedDisplay(wishes) as display:
        run = DisplayLoop(display, ProxyBody(PLATE, (), R)).run(2990, paced=False)
    assert not run.forces[:1000].any()
    assert run.forces[-1, 2] > 0.1


def test_the_loop_keeps_to_the_clock_and_says_by_how_much_not() -> None:
    with SimulatedDisplay(pressed(1e-3, 400)) as display:
        loop = DisplayLoop(display, ProxyBody(PLATE, (), R))
        loop.run(1, paced=False)
        seen: list[FloatArray] = []
        begin = time.monotonic()
        run = loop.run(300, look=lambda records: bool(seen.append(records)))
    took, late = time.monotonic() - begin, run.column("late")
    missed = late[late > 1e-3].sum()  # on a busy machine
    assert -2e-3 < took - 0.3 - missed < 0.2
    assert run.steps == 300 and run.lost == 0
    assert sum(map(len, seen)) == 300
    assert (run.column("late") >= 0.0).all() and np.median(run.column("computing")) < 1e-3


def test_a_look_may_stop_it() -> None:
    with SimulatedDisplay(pressed(1e-3, 4000)) as display:
        run = DisplayLoop(display, ProxyBody(PLATE, (), R)).run(4000, look=lambda records: True)
    assert run.reason == "stopped" and run.steps < 2000


def test_a_device_that_hangs_in_read_is_let_go_of_by_the_guard(monkeypatch: pytest.MonkeyPatch) -> None:
    assert loop_module.STUCK_TIME + loop_module.GUARD_PERIOD <= 5e-3
    monkeypatch.setattr(loop_module, "STUCK_TIME", 0.1)  # so long a busy machine keeps nobody waiting
    hang, count = 1.0, 0

    def read() -> FloatArray:
        nonlocal count
        count += 1
        if count == 20:
            time.sleep(hang)
        return np.array([0.0, 0.0, R + (1e-3 if count < 5 else -1e-3) + 1e-9 * count])

    device = Led(read, 1000.0, 1.0)
    stamps: list[float] = []
    device._calls = python_calls(read, lambda force: (device.forces.append(force), stamps.append(time.monotonic()))[0])
    run = DisplayLoop(device, ProxyBody(PLATE, (), R)).run(200)
    zero = next(i for i, force in enumerate(device.forces) if i > 10 and not force.any())
    assert stamps[zero] - stamps[zero - 1] < 0.5 * hang
    assert run.steps < 200 and run.reason == "the device hung: no step for 4 ms"


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: SimulatedDisplay(np.zeros((0, 3))), "finite, of shape"),
        (lambda: SimulatedDisplay(np.zeros((1, 3)), rate=0.0), "rate must be positive"),
        (lambda: SimulatedDisplay(np.zeros((1, 3)), damping=-1.0), "at least 0"),
        (lambda: SimulatedDisplay(np.zeros((1, 3)), fault="broken"), "unknown fault"),  # type: ignore[arg-type]
        (lambda: Rendering(stiffness=0.0), "stiffness must be positive"),
        (lambda: Rendering(friction=-0.1), "friction must be at least 0"),
    ],
)
def test_what_cannot_be_is_refused(make, message: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(FingerError, match=message):
        make()


def test_a_device_that_says_nothing_is_refused_before_anything_runs() -> None:
    device = Led(lambda: None, 1000.0, 1.0)
    with pytest.raises(FingerError, match="gives no sample"):
        DisplayLoop(device, ProxyBody(PLATE, (), R)).run(10)
