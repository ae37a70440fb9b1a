"""GrblController: one motion controller of the Grbl family on a serial port, spoken to by its documents."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from itertools import takewhile
from typing import NamedTuple

import numpy as np

from hw import FingerError, Lines, Link, LinkError, StoppedError
from hw.grbl import protocol as protocol
from hw.grbl.protocol import GrblSettings, Probed, Status
from mapping import FloatArray

# A status is asked for this often while something is waited for (10 to 50 Hz), s
POLL = 0.05
# With no sign of life for so long the controller is taken for lost, s
LONGEST_CONTROLLER_SILENCE = 1.5

# Reports that are kept: ten seconds of asking as fast as a port can answer
KEPT_REPORTS = 50_000


class Report(NamedTuple):
    """A status report: true at some moment of the round trip that ended at `at`, s, time.monotonic.

    Args:
        at: when it arrived.
        status: what it says.
        round_trip: s since it was asked for; 0 if it came unasked.
    """

    at: float
    status: Status
    round_trip: float


class GrblController:
    """Connects, identifies, moves, probes, stops. Positions are machine coordinates in metres.

    Nothing here moves anything before `move`, `probe`, `jog` or `home` is called.

    Args:
        port: device name or pyserial URL.
        baudrate: bits per second.
        wake: longest time that the controller may need to answer after the port is opened, s (boards of the
            Arduino kind restart when it is).

    Raises:
        LinkError: no port, no answer.
        FingerError: it answers, but not as an idle controller of this family.
    """

    def __init__(self, port: str, *, baudrate: int = 115200, wake: float = 4.0) -> None:
        self.link = Link(port, Lines(), self._hear, baudrate=baudrate, lost=self._notify)
        self.wake = wake
        self.version = ""
        self.settings = GrblSettings()
        self.offset = np.zeros(3)
        self.alarm: str | None = None
        self.stop_reason: str | None = None
        self.reports: deque[Report] = deque(maxlen=KEPT_REPORTS)
        self._asked: float | None = None
        self._news = threading.Condition()
        self._answers: deque[str] = deque()
        self._feedback: list[str] = []
        self._sent: deque[int] = deque()
        self._restarts = 0

    # connection

    def open(self) -> GrblController:
        """Open the port, wait for a sign of life, read the settings. Nothing moves."""
        self.link.open()
        try:
            status = self._first_status()
            if status.state not in ("Idle", "Alarm", "Check", "Sleep"):
                raise FingerError(
                    f"{self.link.port}: the machine is in state {status.state}; wait until it is idle, or stop it"
                )
            self.alarm = "the machine is locked (state Alarm)" if status.state == "Alarm" else None
            self.version = " ".join(line for line in self._ask("$I") if line.startswith("["))
            self.settings = GrblSettings.of(self._ask("$$"))
            if not self.settings.values:
                raise FingerError(f"{self.link.port}: answers, but prints no settings to $$: not a Grbl controller?")
            if self.alarm is None:
                self.set_up()
        except BaseException:
            self.link.close()
            raise
        return self

    def _first_status(self) -> Status:
        until = time.monotonic() + self.wake
        while time.monotonic() < until:
            try:
                return self.status(within=0.3)
            except LinkError:
                if not self.link.is_open:
                    raise
        raise LinkError(
            f"{self.link.port}: no answer to a status request within {self.wake:g} s; "
            "is it a Grbl controller, powered, and is the baud rate right?"
        )

    def set_up(self) -> None:
        """Millimetres, absolute, feed per minute; read the work offset."""
        self.command("G21G90G94")
        self.offset = protocol.parse_offset(self.command("$#"), self.command("$G")) * self.settings.report_scale

    def close(self) -> None:
        """Let go of the port."""
        self.link.close()

    # commands

    def command(self, line: str, within: float = 2.0) -> list[str]:
        """Send one line and wait for its answer (send-response); the feedback lines that came before it.

        Raises:
            FingerError: the controller answers with an error.
            StoppedError: an alarm, a restart or a stop came instead.
            LinkError: no answer in time.
        """
        self._check()
        return self._ask(line, within)

    def _ask(self, line: str, within: float = 2.0) -> list[str]:
        with self._news:
            self._answers.clear()
            self._feedback = []
        restarts, alarm = self._restarts, self.alarm
        self.link.write(line.encode("ascii") + b"\n")
        self._wait(lambda: bool(self._answers), within, f"an answer to {line!r}", restarts, alarm)
        with self._news:
            answer, feedback = self._answers.popleft(), list(self._feedback)
        if answer != "ok":
            raise FingerError(f"{self.link.port}: {line!r} refused: {protocol.describe(answer)}")
        return feedback

    def status(self, within: float = 1.0) -> Status:
        """A report asked for now. Raises LinkError."""
        since = time.monotonic()
        while time.monotonic() < since + within:
            self._request()
            with self._news:
                if self._news.wait_for(lambda: self._fresh(since) or not self.link.is_open, timeout=0.2):
                    break
        if not self._fresh(since):
            raise LinkError(self.link.error or f"{self.link.port}: no status report within {within:g} s")
        return self.reports[-1].status

    def _request(self) -> None:
        """Ask for a report; its round trip counts from the first asking that is not answered yet."""
        if self._asked is None:
            self._asked = time.monotonic()
        self.link.write(protocol.STATUS)

    def _fresh(self, since: float) -> bool:
        return bool(self.reports) and self.reports[-1].at > since

    def reported(self, since: float) -> list[Report]:
        """What arrived since then."""
        recent = takewhile(lambda report: report.at >= since, reversed(list(self.reports)))
        return list(recent)[::-1]

    @property
    def paused(self) -> bool:
        """True while the operator holds the machine or its door is open."""
        return bool(self.reports) and self.reports[-1].status.state in ("Hold", "Door")

    def position(self) -> FloatArray:
        """(3,) machine position now, m."""
        return self.machine_position(self.status())

    def machine_position(self, status: Status) -> FloatArray:
        """(3,) machine position in a report, m."""
        metres = status.position * self.settings.report_scale
        return metres if status.is_machine else metres + self.offset

    def move(self, target: FloatArray, speed: float, within: float) -> None:
        """Straight to a target (3,), m, at a speed, m/s; returns when the machine stands there."""
        self.command(f"G53G1{protocol.words(target)}{protocol.feed_word(speed)}")
        # a dwell is answered when all motion before it is done: sooner and surer than asking for the state
        self.command("G4P0.001", within)

    def probe(self, target: FloatArray, speed: float, within: float) -> Probed:
        """Towards a target (3,) until the probe closes; the latched position (m), and whether it closed.

        G38.3 raises no alarm where nothing is met. The latched position is where the probe closed; where the
        machine came to rest lies further on by its braking distance.
        """
        work = target - self.offset  # probing obeys the work coordinates: G53 is not for G38
        lines = self.command(f"G38.3{protocol.words(work)}{protocol.feed_word(speed)}", within)
        found = [result for result in map(protocol.parse_probe, lines) if result is not None]
        if not found:
            # FluidNC and builds without the message still keep the result
            found = [result for result in map(protocol.parse_probe, self.command("$#")) if result is not None]
        if not found:
            raise LinkError(f"{self.link.port}: the controller did not report where it probed; the line was garbled")
        return Probed(found[-1].position * self.settings.report_scale, found[-1].hit)

    # streaming

    def jog(self, target: FloatArray, speed: float, within: float = 1.0) -> None:
        """Queue a cancellable motion to a target (3,), m; returns when its line fits the receive buffer.

        Lines are counted by their characters until they are answered, as Grbl's documents ask for streams.

        Raises:
            FingerError: an earlier line was refused.
            StoppedError, LinkError: as for `command`.
        """
        self._check()
        line = f"$J=G53{protocol.words(target)}{protocol.feed_word(speed)}\n".encode("ascii")
        self._settle_answers()
        if sum(self._sent) + len(line) >= protocol.RECEIVE_BUFFER:
            restarts = self._restarts
            room = protocol.RECEIVE_BUFFER - len(line)
            self._wait(lambda: self._room(room), within, "room in the receive buffer", restarts, None)
            self._settle_answers()
        self._sent.append(len(line))
        self.link.write(line)

    def _room(self, room: int) -> bool:
        return sum(list(self._sent)[len(self._answers) :]) < room

    def _settle_answers(self) -> None:
        with self._news:
            while self._answers:
                answer = self._answers.popleft()
                if self._sent:
                    self._sent.popleft()
                if answer != "ok":
                    raise FingerError(f"{self.link.port}: a jog was refused: {protocol.describe(answer)}")

    def cancel_jog(self, within: float = 2.0) -> None:
        """Stop jogging, forget what is queued, wait until the machine stands."""
        self._settle_answers()
        self.link.write(protocol.JOG_CANCEL)
        until = time.monotonic() + within
        while (state := self.status().state) in ("Jog", "Run"):
            if time.monotonic() > until:
                raise LinkError(f"{self.link.port}: still {state} {within:g} s after the jog was cancelled")
            time.sleep(0.1 * POLL)
        self._sent.clear()
        self._check()

    def wait_idle(self, within: float) -> None:
        """Wait until every jog is answered and nothing moves; an operator's hold stops the clock.

        Raises:
            FingerError: a jog was refused.
            StoppedError, LinkError: as for `command`.
        """
        until = time.monotonic() + within
        while self.status().state in ("Jog", "Run", "Hold", "Door") or self._sent:
            self._check()
            self._settle_answers()
            if self.paused:
                until = max(until, time.monotonic() + 1.0)
            if time.monotonic() > until:
                raise LinkError(f"{self.link.port}: the motion does not end within {within:g} s")
            time.sleep(0.1 * POLL)

    def unlock(self) -> None:
        """$X: leave the alarm state without moving; the position must be trusted."""
        self.alarm = None
        self._ask("$X")
        self.set_up()

    def home(self, within: float = 120.0) -> None:
        """$H: find machine zero. MOVES the machine."""
        self.alarm = None
        self.link.write(b"$H\n")
        restarts = self._restarts
        with self._news:
            self._answers.clear()
        # no status is answered while homing: only the port itself is watched
        self._wait(lambda: bool(self._answers), within, "the end of homing", restarts, None, stale=within)
        if (answer := self._answers.popleft()) != "ok":
            raise FingerError(f"{self.link.port}: homing refused: {protocol.describe(answer)}")
        self.set_up()

    # stopping

    def halt(self, reason: str) -> None:
        """Feed hold and jog cancel, at once, from any thread; what waits is told the reason. Never raises."""
        self.stop_reason = self.stop_reason or reason
        with suppress(LinkError):
            self.link.write(protocol.HOLD + protocol.JOG_CANCEL)
        self._notify()

    def clear(self, within: float = 3.0) -> bool:
        """After a halt: throw away what is queued and be ready again; True if the position is still known."""
        until = time.monotonic() + within
        status = self.status()
        while status.state in ("Run", "Jog", "Hold", "Home") and status.substate != 0 and time.monotonic() < until:
            if status.state != "Hold":
                self.link.write(protocol.HOLD)
            time.sleep(0.4 * POLL)
            status = self.status()
        before = self._restarts
        self.link.write(protocol.RESET)
        with self._news:
            self._news.wait_for(lambda: self._restarts > before, timeout=within)
        status = self.status()
        self._restarts, self.stop_reason = before, None
        self._sent.clear()  # the reset threw away what was queued: it will not be answered
        if status.state == "Alarm" or self.alarm is not None:
            self.alarm = self.alarm or "the machine is locked (state Alarm)"
            return False
        self.set_up()
        return True

    # hearing

    def _hear(self, now: float, lines: list[bytes]) -> None:
        with self._news:
            for raw in lines:
                self._sort(now, raw.decode("ascii").strip())
            self._news.notify_all()

    def _sort(self, now: float, line: str) -> None:
        if line.startswith("<"):
            status = protocol.parse_status(line)
            if status is not None:
                asked, self._asked = self._asked, None
                self.reports.append(Report(now, status, 0.0 if asked is None else now - asked))
                if status.offset is not None:
                    self.offset = status.offset * self.settings.report_scale
        elif line == "ok" or line.startswith("error:"):
            self._answers.append(line)
        elif line.startswith("ALARM:"):
            self.alarm = protocol.describe(line)
        elif line.startswith("Grbl"):
            self._restarts += 1
        else:
            self._feedback.append(line)

    def _notify(self) -> None:
        with self._news:
            self._news.notify_all()

    def _check(self) -> None:
        if self.stop_reason is not None:
            raise StoppedError(self.stop_reason)
        if self.alarm is not None:
            raise StoppedError(f"{self.link.port}: {self.alarm}")
        if not self.link.is_open:
            raise LinkError(self.link.error or f"{self.link.port} is not open")

    def _wait(
        self,
        done: Callable[[], bool],
        within: float,
        what: str,
        restarts: int,
        alarm: str | None,
        stale: float = LONGEST_CONTROLLER_SILENCE,
    ) -> None:
        """Wait for news, asking for a status meanwhile, so that silence is noticed soon."""
        until = time.monotonic() + within
        while True:
            with self._news:
                if self._news.wait_for(lambda: done() or self._trouble(restarts, alarm), timeout=POLL) and done():
                    return
            if self.alarm != alarm or self.stop_reason is not None or not self.link.is_open:
                self._check()
            if self._restarts != restarts:
                raise StoppedError(f"{self.link.port}: the controller restarted; home it or check its position")
            now = time.monotonic()
            if self.paused:
                until = max(until, now + 1.0)  # by the operator: the clock stands
            if now > until or now - self.link.heard > stale:
                silent = f"{now - self.link.heard:.1f} s of silence while waiting for {what}"
                raise LinkError(f"{self.link.port}: {silent}; check cable and power, reset the controller")
            self._request()

    def _trouble(self, restarts: int, alarm: str | None) -> bool:
        changed = self._restarts != restarts or self.alarm != alarm
        return changed or self.stop_reason is not None or not self.link.is_open
