"""Clocks, delays and the joining of stage and sensor, against known clocks and delays."""

from __future__ import annotations

import numpy as np
import pytest

from hw.emulated.force import OptoForceEmulator
from hw.emulated.grbl import GrblEmulator
from hw.emulated.pty_server import PtyServer
from hw.emulated.touched_body import TouchedBody
from hw.grbl.controller import GrblController, Report
from hw.grbl.frame import StageFrame
from hw.grbl.guarded_stage import GuardedStage
from hw.grbl.protocol import parse_status
from hw.probing.fusion import (
    estimate_delay,
    known_at,
    no_spikes,
    on_the_way,
    places_at,
    progress_at,
    prompt,
    rigid_centers,
)
from hw.probing.lag import measured_delay
from hw.sensors.clock import SensorClock, missing, unwrapped
from hw.sensors.optoforce import OptoForce
from mapping.surface import Surface


def test_the_sensors_clock_is_found_through_jitter_that_only_delays() -> None:
    rng = np.random.default_rng(4)
    ticks = np.arange(20_000.0)
    arrivals = 5.0 + 1.0003e-3 * ticks + rng.exponential(2e-3, len(ticks))
    clock = SensorClock.estimate(ticks, arrivals, 1e-3)
    assert clock.period == pytest.approx(1.0003e-3, rel=2e-6)
    assert np.abs(clock.times(ticks) - 5.0 - 1.0003e-3 * ticks).max() < 5e-5


def test_what_waited_in_a_buffer_until_the_port_was_read_says_nothing_of_the_clock() -> None:
    ticks = np.arange(20_000.0)
    taken = 1.0003e-3 * ticks
    for since, read in ((0.0, 12.0), (3.0, 6.0)):  # from the beginning, and while the program was stopped
        arrivals = np.where((taken > since) & (taken < read), read + 0.03 * (taken - since) / (read - since), taken)
        clock = SensorClock.estimate(ticks, arrivals, 1e-3)
        assert clock.period == pytest.approx(1.0003e-3, rel=2e-6)
        assert np.abs(clock.times(ticks) - taken).max() < 1e-4


def test_a_counter_that_starts_anew_runs_on_and_its_gaps_are_counted() -> None:
    counter = (65500 + np.delete(np.arange(200), [50, 51, 120])) % 65536
    ticks = unwrapped(counter, 16)
    assert ticks[-1] - ticks[0] == 199
    assert missing(ticks) == 3


def test_the_delay_is_found_from_one_touch_whatever_the_height_of_contact() -> None:
    delay, stiffness, speed = 0.013, 1e4, 2e-3
    t = np.arange(0.0, 2.0, 0.001)
    height = np.abs(t - 1.0) * speed - 0.5e-3  # down to -0.5 mm and up again
    force = stiffness * np.maximum(-0.37e-3 - height, 0.0)
    reports = np.arange(0.0, 2.0, 0.02)
    found = estimate_delay(reports, np.interp(reports, t, height), t + delay, force, 0.2)
    assert found == pytest.approx(delay, abs=2e-4)


PERIOD = 0.01  # s
NO_DOUBT = np.zeros(2)


def test_between_two_reports_a_stage_goes_the_ways_that_it_was_sent() -> None:
    ends = 1e-4 * np.array([[0.0, 0, 0], [1, 0, 1], [2, 0, 3], [3, 0, 0], [4, 0, 0]])
    times = np.array([0.0, 0.005, 0.01, 0.025, 0.04])
    progress = progress_at(times, np.array([0.0, 0.04]), NO_DOUBT, np.array([0.0, 4.0]), PERIOD)
    assert progress.least == pytest.approx(times / PERIOD)
    assert progress.most == pytest.approx(times / PERIOD)
    # where the straight line between the two reports would be 0.15 mm off
    found = places_at(progress.likely, ends)
    assert found[:, 2] == pytest.approx(1e-4 * np.array([0.0, 0.5, 1.0, 1.5, 0.0]))
    assert known_at(progress, ends, np.tile([0.0, 0.0, 1.0], (5, 1)), 1e-9).all()
    assert rigid_centers(found[1:2], np.array([[0.0, 0.0, 2.0]]), 1e4)[0, 2] == pytest.approx(0.5e-4 + 2e-4)


def test_outside_of_the_reports_nothing_is_known() -> None:
    progress = progress_at(np.array([-0.01, 0.05]), np.array([0.0, 0.04]), NO_DOUBT, np.array([0.0, 4.0]), PERIOD)
    assert np.isnan(progress.likely).all()
    assert not known_at(progress, np.zeros((5, 3)), np.tile([0.0, 0.0, 1.0], (2, 1)), 1.0).any()


def test_a_stand_hides_the_way_on_a_flank_and_nothing_on_the_flat() -> None:
    # three ways in 60 ms: it stood for half of the time, and nobody knows when
    times, up = np.linspace(0.0, 0.06, 13), np.tile([0.0, 0.0, 1.0], (13, 1))
    progress = progress_at(times, np.array([0.0, 0.06]), NO_DOUBT, np.array([0.0, 3.0]), PERIOD)
    for stand in np.linspace(0.0, 0.03, 7):
        true = np.interp(times, [0.0, 0.015, 0.015 + stand, 0.03 + stand, 0.06], [0.0, 1.5, 1.5, 3.0, 3.0])
        assert (progress.least <= true + 1e-12).all()
        assert (true <= progress.most + 1e-12).all()
    flank = 1e-4 * np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 1]])
    known = known_at(progress, flank, up, 1e-5)
    assert known[[0, -1]].all()
    assert not known[6:-2].any()
    assert known_at(progress, flank * [1.0, 1.0, 0.0], up, 1e-9).all()


def test_a_report_that_took_its_time_hides_what_the_stage_moved_across_the_surface_meanwhile() -> None:
    stamps, ways = np.array([0.0, 0.01, 0.02, 0.03]), np.array([0.0, 1.0, 2.0, 3.0])
    ends, up = np.zeros((4, 3)), np.tile([0.0, 0.0, 1.0], (3, 1))
    ends[:, 0], ends[2:, 2] = [0.0, 1e-4, 2e-4, 3e-4], 5e-5  # 5 mm/s for 10 ms
    times = np.array([0.005, 0.015, 0.025])
    for doubt, known in ((0.0, True), (1e-3, True), (4e-3, False)):
        progress = progress_at(times, stamps, np.array([0.0, 0.0, doubt, 0.0]), ways, PERIOD)
        assert known_at(progress, ends, up, 1e-5).tolist() == [True, known, True]


def test_reports_that_came_late_to_a_busy_host_are_not_trusted() -> None:
    status = parse_status("<Idle|MPos:0.000,0.000,0.000|FS:0,0>")
    assert status is not None
    reports = [Report(0.1 * k, status, 2e-4 if k != 3 else 5e-3) for k in range(6)]
    assert [report.at for report in prompt(reports)] == [0.1 * k for k in (0, 1, 2, 4, 5)]


def test_in_a_corner_the_spring_pulls_from_where_the_rigid_ball_rests() -> None:
    # a wedge opening upwards, 90 degrees: the ball rests on both sides, its centre sqrt(2) r above the edge
    r, stiffness = 5e-3, 1e4
    corners = [[0, -1, 0], [0, 1, 0], [1, -1, 1], [1, 1, 1], [-1, -1, 1], [-1, 1, 1]]
    body = TouchedBody(
        Surface(0.05 * np.array(corners, dtype=float), [[0, 2, 1], [1, 2, 3], [0, 1, 4], [1, 5, 4]]), r, None, stiffness
    )
    rest = np.array([0.0, 0.0, np.sqrt(2.0) * r])
    for off in ([0.0, 0.0, -1e-4], [2e-5, 0.0, -1e-4], [-3e-5, 1e-3, -5e-5]):
        place = rest + off
        resting = rigid_centers(place[None], body.force(place)[None], stiffness)[0]
        assert resting == pytest.approx(np.array([0.0, off[1], rest[2]]), abs=1e-9)


def test_on_one_side_the_spring_pulls_along_its_normal() -> None:
    corners = 0.02 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    body = TouchedBody(Surface(corners, [[0, 1, 2], [0, 2, 3]]), 0.005, None, 1e4)
    assert body.force(np.array([1e-3, 2e-3, 0.0049])) == pytest.approx([0.0, 0.0, 1.0])
    assert not body.force(np.array([1e-3, 2e-3, 0.0051])).any()


@pytest.mark.slow
def test_a_latency_put_into_the_emulated_sensor_is_measured_through_the_ports() -> None:
    frame, found = StageFrame.of((-0.15, -0.15, -0.05)), []
    corners = 0.02 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    body = TouchedBody(Surface(corners, [[0, 1, 2], [0, 2, 3]]), 0.005, frame, 1e4)
    for latency in (0.0, 0.06):
        stage = GrblEmulator(body, np.array([-0.15, -0.15, -0.042]))
        with PtyServer([stage, OptoForceEmulator(stage, noise=0.003, latency=latency)]) as server:
            controller = GrblController(server.ports[0]).open()
            with OptoForce(server.ports[1], 400.0) as sensor:
                guarded = GuardedStage(controller, frame, controller.settings.bounds, 0.03, 2e-4, sensor)
                found.append(measured_delay(guarded, sensor, np.array([0.0, 0.0, -1.0]), 1e4)[0])
            controller.close()
    # the scheduling of a busy host is in both; the difference is the latency
    assert found[1] - found[0] == pytest.approx(0.06, abs=0.02)


def test_reports_that_a_garbled_digit_puts_aside_or_out_of_their_order_are_left_out() -> None:
    ends = np.column_stack([1e-4 * np.arange(101), np.zeros(101), 2e-6 * np.arange(101) % 1e-5])
    sent = 0.01 * np.arange(101)
    times = np.linspace(0.015, 1.0, 800)
    at = (times - 0.012) / 0.01  # the machine is a good way behind what it is sent
    places = np.column_stack([np.interp(at, np.arange(101), ends[:, k]) for k in range(3)])
    wrong = np.random.default_rng(0).choice(800, 80, replace=False)
    told = places.copy()
    # a digit of hundredths of millimetres across the path, or of tenths along it; two next to one another as well
    told[wrong[:40], 2] += 4e-5
    told[wrong[40:], 0] -= 2e-4
    keep, ways = on_the_way(times, told, sent, ends, np.arange(101.0), queued=4, off=8e-6)
    assert not keep[wrong].any()
    assert keep.sum() >= 800 - len(wrong) - 2
    assert ways[keep] == pytest.approx(at[keep].clip(0.0), abs=1e-6)


def test_a_stage_that_presses_in_and_out_on_the_spot_is_on_its_way() -> None:
    depth = 1e-5 * np.array([0.0, 1, 2, 3, 2, 1, 2, 3, 3])
    ends = np.column_stack([np.zeros(9), np.zeros(9), -depth])
    times = np.linspace(0.0, 0.08, 200)
    places = np.column_stack([np.zeros(200), np.zeros(200), np.interp(times - 0.012, 0.01 * np.arange(9), -depth)])
    keep, _ = on_the_way(times, places, 0.01 * np.arange(9), ends, np.zeros(9), queued=4, off=1e-9)
    assert keep.all()


def test_a_lone_sample_off_its_neighbours_is_no_force() -> None:
    rng = np.random.default_rng(1)
    forces = 0.003 * rng.standard_normal((2000, 3)) + np.linspace(0.0, 5.0, 2000)[:, None]
    assert no_spikes(forces, np.full(3, 0.003))[2:-2].all()
    forces[700, 1] += 0.05
    forces[1200, 1] += 0.05
    forces[1201, 2] -= 0.2
    garbled = [700, 1200, 1201]
    assert np.flatnonzero(~no_spikes(forces, np.full(3, 0.003))[2:-2]).tolist() == [at - 2 for at in garbled]
    assert not no_spikes(forces, np.full(3, 0.003))[[0, 1, -2, -1]].any(), "nobody bears them out"
