"""The Grbl driver against the emulator through a real pseudo-terminal, and the protocol against its document."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import count

import numpy as np
import pytest

from hw.emulated.faults import Fault
from hw.emulated.force import LineSensorEmulator, OptoForceEmulator
from hw.emulated.grbl import GrblEmulator
from hw.emulated.pty_server import PtyServer
from hw.emulated.touched_body import TouchedBody
from hw.errors import FingerError, LinkError, StoppedError
from hw.finger import Finger
from hw.grbl import protocol as protocol
from hw.grbl.controller import GrblController
from hw.grbl.frame import StageFrame
from hw.move import Move
from hw.probing.grbl_finger import GrblFinger
from hw.probing.peck import Peck
from hw.probing.slide import Slide
from hw.sensors.line_sensor import LineSensor
from hw.sensors.optoforce import OptoForce
from mapping.geometry.contact.first_contact import BallContact
from mapping.surface import Surface
from mapping.trace import Trace

R = 0.005
FRAME = StageFrame.of((-0.15, -0.15, -0.05), (0.0, 0.0, 0.4))
DOWN = np.array([0.0, 0.0, -1.0])
PECK = Peck(step=1e-3, clearance=5e-4, speed=0.02, stroke=R)

SLOW = pytest.mark.slow


def tile_with_block(height: float = 8e-4) -> Surface:
    """A square of 60 mm with a flat block of 20 mm on its middle."""

    def square(size: float, z: float) -> np.ndarray:
        return np.array([[-size, -size, z], [size, -size, z], [size, size, z], [-size, size, z]])

    faces = np.array([[0, 1, 2], [0, 2, 3]])
    return Surface(np.concatenate([square(0.03, 0.0), square(0.01, height)]), np.concatenate([faces, faces + 4]))


@contextmanager
def machine(pace: float = 20.0, sensor: str = "", **settings: object) -> Iterator[tuple[PtyServer, GrblEmulator]]:
    body = TouchedBody(tile_with_block(), R, FRAME, 1e4)
    stage = GrblEmulator(body, np.array([-0.15, -0.15, -0.03]), **settings)  # type: ignore[arg-type]
    kinds = {"optoforce": OptoForceEmulator, "line": LineSensorEmulator}
    devices = [stage, kinds[sensor](stage, noise=0.003)] if sensor else [stage]
    with PtyServer(devices, pace=pace) as server:
        yield server, stage
    assert server.error is None


def pecker(server: PtyServer, **settings: object) -> GrblFinger:
    given = {"armed": True, "peck": PECK, "frame": FRAME, "position_known": True} | settings
    return GrblFinger(port=server.ports[0], tip_radius=R, **given)  # type: ignore[arg-type]


def across(x: float = 0.02, y: float = 0.001, **settings: object) -> Move:
    return Move(np.array([[-x, y, 0.98 * R], [x, y, 0.98 * R]]), DOWN, **{"speed": 0.02} | settings)  # type: ignore[arg-type]


def off_the_body(centers: np.ndarray) -> np.ndarray:
    above = BallContact(tile_with_block(), R).first_contact(centers - 2 * R * DOWN, DOWN)
    return centers[:, 2] - above.centers[:, 2]


# the protocol


def test_status_reports_are_read_as_the_document_writes_them() -> None:
    status = protocol.parse_status(
        "<Hold:0|WPos:-2.500,0.000,11.000|Bf:15,128|FS:500,8000|Pn:PZ|WCO:0.000,1.551,5.664>"
    )
    assert status is not None
    assert (status.state, status.substate, status.is_machine, status.probe_closed) == ("Hold", 0, False, True)
    assert status.position.tolist() == [-2.5, 0.0, 11.0]
    assert status.offset is not None and status.offset.tolist() == [0.0, 1.551, 5.664]
    assert (status.blocks, status.bytes) == (15, 128)
    # grblHAL: a fourth axis and fields that Grbl does not have
    more = protocol.parse_status("<Idle|MPos:0.000,-10.000,5.000,90.000|FS:0,0,0|SC:|MPG:0|H:1,7|T:0>")
    assert more is not None and more.is_machine and more.position.tolist() == [0.0, -10.0, 5.0]
    for broken in ("<Idle|MPos:0.0", "<Idle>", "Idle|MPos:1,2,3>", "<Idle|MPos:1,2>", "<Run|MPos:1,2,x|FS:0,0>"):
        assert protocol.parse_status(broken) is None
    # a digit lost, a digit twice, the point lost
    for place in ("-147.50,-150.000,-44.900", "-147.500,-150.0000,-44.900", "-147.500,-150000,-44.900"):
        assert protocol.parse_status(f"<Jog|MPos:{place}|FS:600,0>") is None
        assert protocol.parse_probe(f"[PRB:{place}:1]") is None


def test_probe_results_settings_and_offsets_are_read() -> None:
    probed = protocol.parse_probe("[PRB:-150.004,2.000,-7.125:1]")
    assert probed is not None and probed.hit and probed.position.tolist() == [-150.004, 2.0, -7.125]
    settings = protocol.GrblSettings.of(
        ["$13=1", "$20=1 (soft limits, bool)", "$130=200.000", "$131=300", "$132=80", "$N0=G54"]
    )
    assert settings.report_scale == 0.0254 and settings.soft_limits
    assert settings.bounds.tolist() == [[-0.2, -0.3, -0.08], [0.0, 0.0, 0.0]]
    lines = ["[G54:1.000,2.000,3.000]", "[G55:10.000,20.000,30.000]", "[G92:0.500,0.000,0.000]", "[TLO:2.000]"]
    offset = protocol.parse_offset(lines, ["[GC:G0 G55 G17 G21 G90 G94 M5 M9 T0 F0 S0]"])
    assert offset.tolist() == [10.5, 20.0, 32.0]


# the controller


def test_connecting_moves_nothing_and_sends_no_reset() -> None:
    with machine() as (server, stage):
        before = stage.motion.travelled
        with pecker(server, armed=False) as finger:
            assert isinstance(finger, Finger)
            assert finger.info["firmware"].startswith("[VER:1.1h")
            with pytest.raises(FingerError, match="--arm"):
                finger.execute(across())
            time.sleep(0.1)
        assert stage.motion.travelled == before


def test_a_locked_machine_is_refused_with_the_remedy_and_unlocked_only_when_told() -> None:
    with machine(locked=True) as (server, stage):
        with pytest.raises(FingerError, match="home it"), pecker(server):
            pass
        with pecker(server, unlock=True) as finger:
            assert len(finger.execute(across(x=0.005))) > 3
        assert stage.state == "Idle"


def test_whoever_holds_the_machine_is_told_that_it_waits_for_him(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hw.grbl.controller.SHORTEST_TOLD_HOLD", 0.3)
    told: list[str] = []
    with machine() as (server, stage), pecker(server) as finger:
        whole = len(finger.execute(across(x=0.005)))

        def hold(_: Trace) -> None:
            finger.notice = None
            stage.receive(b"!", stage.motion.time)

        def go_on(what: str) -> None:
            told.append(what)
            stage.receive(b"~", stage.motion.time)

        finger.notice, finger.waiting = hold, go_on
        assert len(finger.execute(across(x=0.005))) == whole
    assert len(told) == 1 and "cycle start" in told[0]


def test_work_offsets_and_inches_do_not_move_where_it_probes() -> None:
    results = []
    for prepare in ((), ("G10L2P2X10Y-20Z5", "G55", "G92X1Y2Z3"), ("$13=1",), ("$10=2",)):
        with machine() as (server, _):
            controller = GrblController(server.ports[0]).open()
            for line in prepare:
                controller.command(line)
            controller.close()
            with pecker(server) as finger:
                results.append(finger.execute(across(x=0.003)).centers)
    for other in results[1:]:
        assert np.abs(other - results[0]).max() < 1e-5


def test_silence_ends_in_an_error_that_says_so() -> None:
    master, slave = os.openpty()
    with pytest.raises(LinkError, match="no answer"):
        GrblController(os.ttyname(slave), wake=0.5).open()
    os.close(master)
    os.close(slave)


def test_a_long_stream_of_jogs_never_overflows_the_receive_buffer() -> None:
    with machine(pace=5.0) as (server, stage):
        controller = GrblController(server.ports[0]).open()
        here = controller.position()
        for i in range(120):
            controller.jog(here + np.array([1e-4 * i, 0.0, 0.0]), 0.02)
        controller.wait_idle(5.0)
        assert np.allclose(controller.position(), here + np.array([119e-4, 0, 0]), atol=1e-5)
        assert stage.lost_bytes == 0
        with pytest.raises(FingerError, match="travel"):
            controller.jog(np.array([0.01, 0.0, 0.0]), 0.02)
            controller.wait_idle(2.0)
        controller.close()


# trust in the position


def test_an_armed_machine_does_not_connect_before_somebody_vouches_for_its_position() -> None:
    with machine() as (server, stage):
        with pytest.raises(FingerError, match="home it"), pecker(server, position_known=False):
            pass
        with pecker(server, position_known=False, home=True) as finger:
            assert finger.stage.controller.vouched
            assert any("$20" in doubt for doubt in finger.info["doubts"]) is False
        assert stage.motion.travelled > 0.0


def test_a_board_that_restarts_when_the_port_is_opened_is_not_trusted() -> None:
    with machine() as (server, stage):
        controller = GrblController(server.ports[0])
        stage.power_cycle()
        controller.open()
        controller._restarts = 1  # the greeting came while it opened
        with pytest.raises(FingerError, match="restarted when the port was opened"):
            controller.vouch()
        controller.close()


def test_a_restart_between_two_commands_ends_the_trust_and_all_motion() -> None:
    with machine() as (server, stage), pecker(server) as finger:
        finger.execute(across(x=0.003))
        stage.power_cycle()
        time.sleep(0.1)
        before = stage.motion.travelled
        with pytest.raises(StoppedError, match="restarted"):
            finger.execute(across(x=0.003))
        assert stage.motion.travelled == before


def test_another_programs_work_offset_ends_the_trust() -> None:
    with machine() as (server, stage), pecker(server) as finger:
        finger.execute(across(x=0.003))
        stage.systems["G54"][:] = (0.0, 0.0, 0.004)
        with pytest.raises(StoppedError, match=r"work offset changed|nothing sent it"):
            for _ in range(20):
                finger.execute(across(x=0.003))


def test_a_tip_that_stands_in_contact_is_backed_off_before_anything_else() -> None:
    with machine() as (server, stage):
        stage.motion.position = FRAME.to_machine(np.array([-0.02, 0.001, R - 1e-4]))
        with pecker(server) as finger:
            trace = finger.execute(across())
        assert np.abs(off_the_body(trace.centers)).max() < 4e-6


def test_the_probe_is_checked_by_the_users_touch() -> None:
    asked: list[str] = []
    with machine() as (server, stage):

        def hand(what: str) -> None:
            asked.append(what)
            stage.motion.probe_fault = "closed" if "touch the tip" in what else ""

        with pecker(server, ask=hand) as finger:
            assert len(finger.execute(across(x=0.003))) > 3
    assert len(asked) == 2


def test_a_machine_that_was_halted_before_its_first_motion_is_left_idle(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hw.probing.grbl_finger.TOUCH_BY_HAND", 0.2)
    with machine(pace=10.0) as (server, stage):
        begun = stage.motion.travelled
        with pytest.raises(FingerError, match="did not close"), pecker(server, ask=lambda what: None) as finger:
            finger.execute(across(x=0.003))
        assert stage.motion.travelled == begun
        with pecker(server) as finger:  # a machine that is held would be refused
            assert len(finger.execute(across(x=0.003))) > 3


@pytest.mark.parametrize("kind", ["garble", pytest.param("lose", marks=SLOW), pytest.param("double", marks=SLOW)])
def test_garbled_doubled_and_lost_reply_bytes_never_become_contacts(kind: str) -> None:
    with machine(pace=10.0) as (server, _), pecker(server) as finger:
        server.faults.append(Fault(kind, at=0.0, rate=0.01, seed=3))
        trace = finger.execute(across(x=0.004))
    assert len(trace) > 0.9 * 24
    assert np.abs(off_the_body(trace.centers)).max() < 2e-5


@SLOW
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", ["garble", "lose", "double"])
def test_of_two_hundred_pecks_with_one_percent_of_reply_bytes_wrong_all_that_is_kept_is_right(
    kind: str, seed: int
) -> None:
    with machine(pace=10.0) as (server, _), pecker(server) as finger:
        server.faults.append(Fault(kind, at=0.0, rate=0.01, seed=seed))
        traces = [finger.execute(across(y=1e-3 * line)) for line in range(5)]
    assert sum(map(len, traces)) >= 0.95 * 205
    for trace in traces:
        assert np.abs(off_the_body(trace.centers)).max() < 2e-5


def test_every_alarm_is_said_in_words_with_the_remedy() -> None:
    for number in range(1, 20):
        assert len(protocol.describe(f"ALARM:{number}")) > 30
    assert "home again" in protocol.describe("ALARM:99")


def test_dtr_and_rts_are_low_before_the_port_opens(monkeypatch: pytest.MonkeyPatch) -> None:
    import serial

    seen: dict[str, object] = {}

    class Port:
        def open(self) -> None:
            seen.update(vars(self))
            raise serial.SerialException("enough")

    monkeypatch.setattr(serial, "serial_for_url", lambda *args, **settings: Port())
    with pytest.raises(LinkError):
        GrblController("/dev/none").open()
    assert seen["dtr"] is False and seen["rts"] is False


# pecking


def test_pecks_are_the_latched_positions_to_a_step_of_the_motor() -> None:
    with machine() as (server, stage), pecker(server) as finger:
        trace = finger.execute(across())
        overshoot = 0.02**2 / (2 * 0.5)
        assert overshoot > 3e-4  # what logging the resting position would have cost
        assert len(trace) == 41
        assert np.abs(off_the_body(trace.centers)).max() < 4e-6
        assert (np.diff(trace.t) > 0).all()
        assert stage.motion.body.force(stage.motion.position).max() == 0.0


def test_every_peck_is_told_of_as_it_is_made() -> None:
    told: list[Trace] = []
    with machine() as (server, _), pecker(server, notice=told.append) as finger:
        trace = finger.execute(across(x=0.003))
    assert [len(batch) for batch in told] == [1] * len(trace)
    assert np.array_equal(Trace.concatenate(told).centers, trace.centers)
    assert np.array_equal(Trace.concatenate(told).t, trace.t)


def test_a_trace_knows_the_step_of_the_motors() -> None:
    with machine() as (server, _), pecker(server) as finger:
        trace = finger.execute(across(x=0.003))
        assert trace.resolution == finger.info["resolution"] == pytest.approx(4e-6)


def test_a_step_too_high_for_the_clearance_is_climbed() -> None:
    with machine() as (server, _), pecker(server, peck=Peck(2e-3, 1e-4, 0.02, R)) as finger:
        trace = finger.execute(across(x=0.015))
    assert trace.centers[:, 2].max() - trace.centers[:, 2].min() > 7e-4
    assert np.abs(off_the_body(trace.centers)).max() < 4e-6


def test_where_nothing_is_met_there_is_no_sample() -> None:
    with machine() as (server, _), pecker(server) as finger:
        trace = finger.execute(Move(np.array([[0.02, 0, R], [0.045, 0, R]]), DOWN, speed=0.02))
    assert 0.03 < trace.centers[:, 0].max() < 0.036
    assert len(trace) < 20


def test_moves_beyond_the_machine_are_refused_before_anything_moves() -> None:
    with machine() as (server, stage), pecker(server) as finger:
        for move, what in ((across(x=0.5), "machine position"), (across(force=99.0), "N"), (across(speed=0.5), "m/s")):
            with pytest.raises(FingerError, match=what):
                finger.execute(move)
        assert stage.motion.travelled == 0.0


def test_leaving_lifts_the_tip_off_and_frees_the_port_even_after_an_error() -> None:
    with machine() as (server, stage):
        with pytest.raises(ZeroDivisionError), pecker(server) as finger:
            finger.execute(across(x=0.003))
            raise ZeroDivisionError
        assert FRAME.to_object(stage.motion.position)[2] > 2.5 * R
        GrblController(server.ports[0]).open().close()


def test_an_alarm_ends_the_sweep_keeps_its_samples_and_moves_nothing_more() -> None:
    with machine(pace=10.0) as (server, stage), pecker(server) as finger:
        told: list[Trace] = []

        def trip(batch: Trace) -> None:
            told.append(batch)
            if len(told) == 5:
                stage.trip(1)

        finger.notice = trip
        trace = finger.execute(across())
        stopped = stage.motion.travelled
        assert 0 < len(trace) < 41
        with pytest.raises(FingerError, match="hard limit"):
            finger.execute(across())
        time.sleep(0.2)
        assert stage.motion.travelled == stopped


# sliding


@pytest.mark.parametrize("kind", ["optoforce", pytest.param("line", marks=pytest.mark.slow)])
def test_sliding_follows_the_body_and_holds_the_force(kind: str) -> None:
    with machine(pace=1.0, sensor=kind) as (server, _):
        sensor = OptoForce(server.ports[1], 400.0) if kind == "optoforce" else LineSensor(server.ports[1], rate=1000.0)
        slide = Slide(sensor, 1e4, approach_speed=5e-3)
        with pecker(server, peck=None, slide=slide) as finger:
            told: list[tuple[float, Trace]] = []
            finger.notice = lambda batch: told.append((time.monotonic() - finger._begun, batch))
            trace = finger.execute(across(x=0.004, y=0.002, speed=0.008))
            assert len(told) > 1 and np.array_equal(Trace.concatenate([batch for _, batch in told]).t, trace.t)
            assert (np.diff(trace.t) > 0).all()
            assert max(when - batch.t[0] for when, batch in told) < 1.0
            assert trace.force is not None and trace.normals is not None
            assert np.abs(off_the_body(trace.centers)).std() < 1.5e-5
            assert np.median(np.linalg.norm(trace.force, axis=1)) == pytest.approx(1.0, abs=0.3)
            assert np.median(trace.normals @ -DOWN) > 0.99
            assert len(trace) > 300


def test_the_guard_stops_the_machine_when_the_force_exceeds_its_limit() -> None:
    with machine(pace=1.0, sensor="optoforce") as (server, stage):
        sensor = OptoForce(server.ports[1], 400.0)
        with pecker(server, peck=None, slide=Slide(sensor, 1e4), max_force=2.0) as finger:
            top = finger.stage.position()
            low = FRAME.to_machine(np.array([top[0], top[1], R - 0.004]))
            with pytest.raises(StoppedError, match="force reached"):
                finger.stage.controller.move(low, 0.01, 10.0)
            sunk = R - FRAME.to_object(stage.motion.position)[2]
            # the limit, the braking distance, and what is travelled in one period of 10 ms (a loaded host: three)
            assert sunk < 2.0 / 1e4 + 0.01**2 / (2 * 0.5) + 0.01 * 0.03 + 8e-4


# ending


SWEEPER = """
import sys, numpy as np
sys.path.insert(0, {tests!r})
import test_grbl_finger as t
class Port: ports = [sys.argv[1]]
with t.pecker(Port) as finger:
    print("moving", flush=True)
    while True:
        finger.execute(t.across())
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, pytest.param(signal.SIGINT, marks=pytest.mark.slow)])
def test_a_signal_stops_the_machine_lifts_the_tip_and_ends_the_program(number: signal.Signals) -> None:
    with machine(pace=2.0) as (server, stage):
        code = SWEEPER.format(tests=os.path.dirname(__file__))
        process = subprocess.Popen([sys.executable, "-c", code, server.ports[0]], stdout=subprocess.PIPE, stderr=-3)
        assert process.stdout is not None and process.stdout.readline() == b"moving\n"
        time.sleep(0.7)
        process.send_signal(number)
        assert process.wait(timeout=10) != 0
        process.stdout.close()
        assert stage.state == "Idle"
        assert FRAME.to_object(stage.motion.position)[2] > 1.8 * R
        still = stage.motion.travelled
        time.sleep(0.1)
        assert stage.motion.travelled == still


@pytest.mark.parametrize(
    ("lines", "name"),
    [
        (["[VER:1.1h.20190825:]", "[OPT:V,15,128]"], "Grbl 1.1h.20190825"),
        (["[VER:1.1f.20240101:]", "[OPT:VNM,35,1024,3,0]", "[FIRMWARE:grblHAL]"], "grblHAL 1.1f.20240101"),
        (["[VER:3.7 FluidNC v3.7.16:]", "[OPT:PHS]"], "FluidNC 3.7.16"),
        (["FIRMWARE_NAME:Marlin 2.1.2 (Github) SOURCE_CODE_URL:github.com/MarlinFirmware"], "Marlin 2.1.2 (Github)"),
        (["echo:busy: processing"], ""),
    ],
)
def test_firmwares_are_told_apart_by_what_they_call_themselves(lines: list[str], name: str) -> None:
    assert protocol.firmware_name(lines) == name


def test_a_printers_firmware_is_refused_by_its_name() -> None:
    """Marlin knows no `?`, and answers every line that it does not know with an echo and ok."""
    host, slave = os.openpty()
    tty.setraw(slave)

    def answer() -> None:
        rest = b""
        with suppress(OSError):
            while data := os.read(host, 256):
                *said, rest = (rest + data).split(b"\n")
                for line in said:
                    named = b"FIRMWARE_NAME:Marlin 2.1.2 SOURCE_CODE_URL:github.com PROTOCOL_VERSION:1.0\nok\n"
                    os.write(host, named if line == b"M115" else b'echo:Unknown command: "' + line + b'"\nok\n')

    threading.Thread(target=answer, daemon=True).start()
    with pytest.raises(FingerError, match=r"this is Marlin 2\.1\.2, which gives no Grbl status reports"):
        GrblController(os.ttyname(slave), wake=0.5).open()


@pytest.mark.parametrize("phase", [0, *(pytest.param(phase, marks=SLOW) for phase in (1, 2))])
def test_a_garbled_report_before_the_first_motion_does_not_say_where_it_begins(phase: int) -> None:
    with machine(pace=10.0) as (server, stage), pecker(server) as finger:
        report, told = stage.report, count(phase)
        stage.report = lambda: report().replace("MPos:-15", "MPos:-18") if next(told) % 3 == 0 else report()
        assert len(finger.execute(across(x=0.003))) > 20


def test_with_a_touch_probe_all_that_the_machine_runs_on_by_stays_within_the_over_travel() -> None:
    with machine(pace=10.0) as (server, stage), pecker(server, over_travel=4e-4) as finger:
        speed, late = finger.stage.guarded_speed, finger.stage.controller.prepared
        assert late * speed + 1.5 * finger.stage.stop_within(speed) == pytest.approx(4e-4)
        deepest, force = [0.0], stage.body.force

        def watched(center: np.ndarray) -> np.ndarray:
            found = force(center)
            deepest[0] = max(deepest[0], float(np.linalg.norm(found)) / stage.body.stiffness)
            return found

        stage.body.force = watched  # type: ignore[method-assign]
        assert len(finger.execute(across(x=0.003))) > 20
        assert 0.1 * 4e-4 < deepest[0] < 4e-4


def test_what_firmwares_have_prepared_is_told_by_their_names() -> None:
    assert protocol.prepared("Grbl 1.1h.20190825") == pytest.approx(0.06)
    assert protocol.prepared("grblHAL 1.1f.20260817") == protocol.prepared("FluidNC 3.7") == pytest.approx(0.1)
