"""GrblController: one motion controller of the Grbl family on a serial port, spoken to by its documents."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from itertools import islice, takewhile
from typing import NamedTuple

import numpy as np

from hw import FingerError, Lines, Link, LinkError, Patience, StopIfKilled, StoppedError
from hw.grbl import protocol as protocol
from hw.grbl.protocol import GrblSettings, Probed, Status
from mapping import FloatArray

# A status is asked for this often while something is waited for (10 to 50 Hz), s
POLL = 0.05
# With no sign of life for so long the controller is taken for lost, s
LONGEST_CONTROLLER_SILENCE = 1.5

# What may have been lost is asked for again after so many usual round trips, and POLL at most, ASK_AGAIN s at least: a
# busy host's threads take turns every 5 ms. What came garbled is asked for again at once
TRIPS_IN_VAIN, ASK_AGAIN = 3.0, 0.01
# An idle machine that answers so many requests and still not the line before them has lost the line or its answer:
# Grbl answers in order, and a line is parsed within 10 ms
UNANSWERED = 6
# So often is a line sent again, or an answer read again, that was lost or garbled: with 1 % of all bytes wrong, 4 % of
# the `ok` and 30 % of the probing results are; 0.3^12 is one in two million
TRIES_OF_A_LINE = 12
# A report may lie this far off the box that holds where the machine was sent, m: ten times Grbl's junction deviation
OFF_THE_WAY = 1e-4
# So many reports in a row off the way, and this near to one another, m, are no garbled ones: at 30 mm/s the machine
# makes 4.5 mm in three requests, a garbled digit seldom strikes the same place twice. Where others were garbled before,
# two more: of 300 times 1,000 simulated reports with 1 % of their bytes lost 2.3 % have three such in a row, 0.3 % four
OFF_THE_WAY_IN_A_ROW, IF_GARBLED_BEFORE, OFF_TOGETHER = 3, 5, 5e-3
# So often is a new work offset told in a row before it is believed; one more where lines were garbled before: with one
# bit of 1 % of all bytes wrong, 36 of 1,000 times 1,000 simulated reports of it have the same wrong one twice in a row,
# none has it thrice
OFFSET_IN_A_ROW, OFFSET_IF_GARBLED_BEFORE = 2, 3

OFFSET_CHANGED = (
    "the work offset changed: another program, or a pendant, set G92, G10 or G54 to G59; end it, check the machine's "
    "position and run again"
)
LOCKED_UNSAID = (
    "the controller is locked (state Alarm): it restarted, or met an alarm whose message was lost on the way, so "
    "nobody knows where it stands; check its supply and cables, home it ($H) and run again with --resume"
)

ANOTHERS_LINE = (
    "a line that this program did not send was refused (error:9): another program, or a pendant, sends lines to the "
    "controller; end it, check the machine's position and run again with --resume"
)
HELD_BY_SOMEBODY = "the machine is held, or its door open: let it go on (cycle start, ~), or end with Ctrl-C"
# A hold that lasts so many s is told of: who holds the machine and lets it go on sooner knows it. Those of our own are
# not waited for here, but end with what they stop (halt)
SHORTEST_TOLD_HOLD = 2.0
# What is sent as one, where it is said that it was refused
A_JOG = "a jog"

# A printer's firmware names itself within so many s
NAMING = 1.0
# After a reset the controller greets within so many s; a greeting that was garbled is not waited for longer
RESTARTING = 1.0
# The link's round trip is the median of so many
RECENT_REPORTS = 15
# and its shortest is the least of so many: two seconds and more of asking as fast as a port can answer
LATEST_REPORTS = 500
# A machine that is asked where it stands does so, and says it twice, within so many s: a line may have been looked at
# late, and with 1 % of all bytes wrong every second report is
LONGEST_TO_A_STAND = 4.0
# Reports that are kept: ten seconds of asking as fast as a port can answer
KEPT_REPORTS = 50_000


class Report(NamedTuple):
    """A status report: true at some moment of the round trip that ended at `at`, s, time.monotonic.

    The question is one byte, which a controller takes at once and answers as it stands then; the answer waits for the
    main loop, the line, and the timers of adapters and hosts. So it is most likely true of when it was asked for.

    Args:
        at: when it arrived.
        status: what it says.
        round_trip: s since it was asked for; inf if it came unasked.
    """

    at: float
    status: Status
    round_trip: float

    @property
    def asked(self) -> float:
        """When it was asked for, s, time.monotonic."""
        return self.at - self.round_trip


class GrblController:
    """Connects, identifies, moves, probes, stops. Positions are machine coordinates in metres.

    Nothing here moves anything before `move`, `probe`, `jog` or `home` is called. What is sent is the way from where
    the motion before it ends (G91), never a place: a controller that restarted, or was told another zero, takes its
    place for another one, and would drive there through whatever stands between. It goes as far as it was sent at most.

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
        self.link = Link(port, Lines(), self._hear, baudrate=baudrate, lost=self._notify, still=True)
        self.wake = wake
        self.version = ""
        self.settings = GrblSettings()
        self.offset = np.zeros(3)
        self.alarm: str | None = None
        self.stop_reason: str | None = None
        self.reports: deque[Report] = deque(maxlen=KEPT_REPORTS)
        self._asked: deque[float] = deque()  # when, for every report that has not come yet
        self._in_vain: float | None = None  # when was asked what is taken for lost since the last report
        self._silent: deque[float] = deque()  # when, for every report that did not come while nothing at all did
        self._news = threading.Condition()
        self._answers: deque[str] = deque()
        self._feedback: list[str] = []
        self._sent: deque[int] = deque()
        self._restarts = 0
        self._restart_expected = True  # opening the port may restart the board
        self.vouched = False
        self.distrust: str | None = None
        self._offset_known = False
        self.implausible = 0
        self._unclear = 0
        self._off_the_way = 0
        self._seen_off: FloatArray | None = None
        self._new_offset: FloatArray | None = None
        self._offset_told = 0  # so often in a row
        self._way: tuple[FloatArray, FloatArray] | None = None  # box of where it was sent; None: not known yet
        self._from: FloatArray | None = None  # where the last motion that was sent ends; None: to be asked
        self._anew = True  # the next motion begins from a stand
        self._jogged = False  # jogs were sent that it may not have looked at
        self.waiting: Callable[[str], None] | None = None  # told in words when it waits for somebody
        self._held: Patience | None = None  # runs out when a hold has lasted long enough to be told of
        self._moves_until = -np.inf  # at the latest, if nothing stops it, but for one ramp

    # connection

    def open(self) -> GrblController:
        """Open the port, wait for a sign of life, read the settings. Nothing moves."""
        self.link.open()
        try:
            status = self._first_status()
            if status.state not in ("Idle", "Alarm", "Check", "Sleep"):
                held = (
                    "let it go on (cycle start, ~), or reset it (Ctrl-X): a machine that stands keeps its place"
                    if status.state in ("Hold", "Door")
                    else "wait until it is idle, or stop it"
                )
                raise FingerError(f"{self.link.port}: the machine is in state {status.state}; {held}")
            self.alarm = "the machine is locked (state Alarm)" if status.state == "Alarm" else None
            self.version = " ".join(line for line in self._ask("$I") if line.startswith("["))
            self.settings = GrblSettings.of(self._agreed("$$"))
            if not self.settings.values:
                raise FingerError(f"{self.link.port}: answers, but prints no settings to $$: not a Grbl controller?")
            if self.alarm is None:
                self.set_up()
            self._restart_expected = False
        except BaseException:
            self.link.close()
            raise
        return self

    def _first_status(self) -> Status:
        patience = Patience(self.wake)
        while not patience.over():
            try:
                return self.status(within=0.3)
            except LinkError:
                if not self.link.is_open:
                    raise
                if patience.left < 0.5 * self.wake:  # a native USB port that waits to be asked
                    self.link.raise_lines()
        if other := self._other_firmware():
            raise FingerError(
                f"{self.link.port}: this is {other}, which gives no Grbl status reports; possible: Grbl 1.1, grblHAL, "
                "FluidNC; a printer under Klipper: examples/klipper"
            )
        raise LinkError(
            f"{self.link.port}: no answer to a status request within {self.wake:g} s; "
            "is it a Grbl controller, powered, and is the baud rate right?"
        )

    def _other_firmware(self) -> str:
        """What a firmware that knows no `?` calls itself, asked as printers are (M115); "" if it is silent."""
        with self._news:
            self._feedback = []
        with suppress(LinkError):
            self.link.write(b"\nM115\n")
        with self._news:
            self._news.wait_for(lambda: bool(protocol.firmware_name(self._feedback)), timeout=NAMING)
            return protocol.firmware_name(self._feedback)

    @property
    def firmware(self) -> str:
        """Grbl, grblHAL or FluidNC, with its version, as it says itself."""
        return protocol.firmware_name([self.version]) or "a firmware of the Grbl family that does not say which"

    @property
    def prepared(self) -> float:
        """What it has prepared of its motion and carries out before it brakes, s."""
        return protocol.prepared(self.firmware)

    def set_up(self) -> None:
        """Millimetres, absolute, feed per minute; read the work offset."""
        self.command("G21G90G94")
        self.offset = protocol.parse_offset(self._agreed("$#"), self._agreed("$G")) * self.settings.report_scale
        self._way, self._new_offset, self._offset_known = None, None, True
        self._from, self._anew, self._jogged = None, True, False

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
        self.check()
        return self._ask(line, within)

    def _ask(self, line: str, within: float = 2.0) -> list[str]:
        """Send a line, again if it or its answer was lost: what is said twice here does the same as said once."""
        for _ in range(TRIES_OF_A_LINE - 1):
            with suppress(_Unanswered):
                return self._ask_once(line, within)
        return self._ask_once(line, within)

    def _agreed(self, line: str) -> list[str]:
        """What two answers have in common: a garbled line of one is in no other."""
        readings = [self._ask(line), self._ask(line)]
        while len(readings) < TRIES_OF_A_LINE and readings[-1] != readings[-2]:
            readings.append(self._ask(line))
        told = {text: sum(text in reading for reading in readings) for reading in readings for text in reading}
        return [text for text, times in told.items() if times > 1]

    def _ask_once(self, line: str, within: float) -> list[str]:
        with self._news:
            self._answers.clear()
            self._feedback = []
        restarts, alarm = self._restarts, self.alarm
        self.link.write(line.encode("ascii") + b"\n")
        self._wait(lambda: bool(self._answers), within, f"an answer to {line!r}", restarts, alarm)
        with self._news:
            answer, feedback = self._answers.popleft(), list(self._feedback)
        if answer != "ok":
            raise self._refused(repr(line), answer)
        return feedback

    def _refused(self, what: str, answer: str) -> FingerError:
        """Why a line was refused: a machine that restarted, or met an alarm, refuses all, and that is said first.

        Raises:
            StoppedError, LinkError: what stopped the machine, if anything did.
        """
        self.check()
        if answer == protocol.LOCKED and self.vouched:
            locked = self.status().state == "Alarm"
            self.check()
            if locked or what == A_JOG:  # one that is not locked refuses so what is no jog, while it jogs
                self._lose_trust(LOCKED_UNSAID if locked else ANOTHERS_LINE)
            self.check()
        return FingerError(f"{self.link.port}: {what} was refused: {protocol.describe(answer)}")

    def status(self, within: float = LONGEST_CONTROLLER_SILENCE) -> Status:
        """A report asked for now. Raises LinkError."""
        since, patience = time.monotonic(), Patience(within)
        while not patience.over():
            again, garbled = self._again, self.garbled
            self._request(again)
            with self._news:
                while not self._fresh(since) and self.garbled == garbled and self.link.is_open:
                    if not self._news.wait(again):
                        break
            if self._fresh(since) or not self.link.is_open:
                break
        if not self._fresh(since):
            raise LinkError(
                self.link.error or f"{self.link.port}: no status report within {within:g} s{patience.held_up}"
            )
        return self.reports[-1].status

    @property
    def _again(self) -> float:
        return min(POLL, max(ASK_AGAIN, TRIPS_IN_VAIN * self.round_trip))

    @property
    def garbled(self) -> int:
        """Lines so far that nobody understands."""
        return self._unclear + self.link.framing.counts.bad

    def _request(self, patience: float = POLL) -> None:
        """Ask for a report; its round trip counts from the first asking that is not answered yet.

        An answer that was lost would make all reports after it look late. So one that did not come for so long, s, is
        taken for lost, and the next report to come for late: nobody knows which of the two it answers. But where
        nothing at all was heard since, nothing was lost: the device, or this program, was held up; each answer comes.
        """
        now = time.monotonic()
        with self._news:
            while self._asked and now - self._asked[0] >= patience:
                lost = self._asked.popleft()
                if self.link.heard < lost:
                    self._silent.append(lost)
                elif self._in_vain is None:
                    self._in_vain = lost
            self._asked.append(now)
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

    def _wait_for_operator(self, patience: Patience) -> None:
        """While the machine is held the clock stands; who listens is told once a hold what would end it.

        A line disturbed on its way to the machine may hold it, too (`!`): then nobody knows that he is waited for.
        """
        if not self.paused:
            self._held = None
            return
        patience.at_least(1.0)
        self._held = self._held or Patience(SHORTEST_TOLD_HOLD)
        if self.waiting is not None and self._held.left > 0.0 and self._held.over():
            self.waiting(HELD_BY_SOMEBODY)

    def position(self) -> FloatArray:
        """(3,) machine position now, m."""
        return self.machine_position(self.status())

    def resting_position(self) -> FloatArray:
        """(3,) machine position, m, as two reports of a standing machine in a row tell it. Raises LinkError.

        If it is idle the next motion begins from there, whatever became of those before: none of them waits any more.
        """
        self._catch_up()
        before, patience = self.status(), Patience(LONGEST_TO_A_STAND)
        while not patience.over():
            after = self.status()
            here = self.machine_position(after)
            if np.abs(here - self.machine_position(before)).max() < self.settings.resolution:
                if before.state == after.state == "Idle":
                    self._from, self._anew = here, True
                return here
            before = after
        raise LinkError(f"{self.link.port}: no two reports of where the machine stands agree; use a shielded cable")

    def _catch_up(self) -> None:
        """Wait until the controller has looked at all jogs that it was sent.

        A report overtakes lines, and a busy host hears it late: it does not tell. Lines are looked at in turn, so an
        answer that no jog has comes after all of theirs, and what is reported after it is true of them.
        """
        if not self._jogged:
            return
        self._settle_answers()
        for _ in range(TRIES_OF_A_LINE):
            if any(line.startswith("[GC:") for line in self._ask("$G")):
                self._sent.clear()
                self._jogged = False
                return
        raise LinkError(f"{self.link.port}: {TRIES_OF_A_LINE} lines were not answered; use a shielded cable")

    def machine_position(self, status: Status) -> FloatArray:
        """(3,) machine position in a report, m."""
        metres = status.position * self.settings.report_scale
        return metres if status.is_machine else metres + self.offset

    def move(self, target: FloatArray, speed: float, within: float) -> None:
        """Straight to a target (3,), m, at a speed, m/s; returns when the machine stands there.

        A line that was lost, or whose answer was, is said again for what is left of the way.
        """
        self.check()
        for _ in range(TRIES_OF_A_LINE):
            way = self._way_to(target, speed)
            with suppress(_Unanswered):
                self._ask_once(f"G21G91G94G1{protocol.words(way)}{protocol.feed_word(speed)}", within)
                break
            self.resting_position()
        else:
            raise LinkError(f"{self.link.port}: {TRIES_OF_A_LINE} lines were not answered; use a shielded cable")
        # a dwell is answered when all motion before it is done: sooner and surer than asking for the state. What other
        # programs say later is meant as places again
        self.command("G90G4P0.001", within)

    def probe(self, target: FloatArray, speed: float, within: float) -> Probed:
        """Towards a target (3,) until the probe closes; the latched position (m), and whether it closed.

        G38.3 raises no alarm where nothing is met. The latched position is where the probe closed; where the
        machine came to rest lies further on by its braking distance.
        """
        self.check()
        way = self._way_to(target, speed)
        lines: list[str] = []
        try:
            with suppress(_Unanswered):  # not said again: the probe may be closed now. The result is kept, read below
                lines = self._ask_once(f"G21G91G94G38.3{protocol.words(way)}{protocol.feed_word(speed)}", within)
        finally:
            self._from = None
        found = self._latched(lines)
        return Probed(found.position * self.settings.report_scale, found.hit)

    def _latched(self, lines: list[str]) -> Probed:
        """The result that was told twice: in its message, and in what the controller keeps of it ($#)."""
        told: list[str] = []
        for _ in range(TRIES_OF_A_LINE):
            told += [line for line in lines if protocol.parse_probe(line) is not None]
            for line in told:
                result = protocol.parse_probe(line)
                if told.count(line) > 1 and result is not None:
                    return result
            lines = self.command("$#")
        raise LinkError(
            f"{self.link.port}: no two of {TRIES_OF_A_LINE} readings of where it probed agree; use a shielded cable"
        )

    # streaming

    def jog(self, target: FloatArray, speed: float, within: float = 1.0) -> None:
        """Queue a cancellable motion to a target (3,), m; returns when its line fits the receive buffer.

        Lines are counted by their characters until they are answered, as Grbl's documents ask for streams.

        Raises:
            FingerError: an earlier line was refused.
            StoppedError, LinkError: as for `command`.
        """
        self.check()
        way = self._way_to(target, speed)
        line = f"$J=G21G91{protocol.words(way)}{protocol.feed_word(speed)}\n".encode("ascii")
        self._settle_answers()
        if sum(self._sent) + len(line) >= protocol.RECEIVE_BUFFER:
            restarts = self._restarts
            room = protocol.RECEIVE_BUFFER - len(line)
            with suppress(_Unanswered):
                self._wait(lambda: self._room(room), within, "room in the receive buffer", restarts, None)
            self._settle_answers()
        self._sent.append(len(line))
        self._jogged = True
        self.link.write(line)

    def _room(self, room: int) -> bool:
        return sum(list(self._sent)[len(self._answers) :]) < room

    def _settle_answers(self) -> None:
        refused = ""
        with self._news:
            while self._answers and not refused:
                answer = self._answers.popleft()
                if self._sent:
                    self._sent.popleft()
                # between two jogs grblHAL now and then calls the next one a cycle ("Run"), and refuses what is said in
                # it: as with a line that was lost, whoever sent it sees that the machine stays behind
                refused = "" if answer in ("ok", protocol.NOT_IDLE) else answer
        if refused:
            raise self._refused(A_JOG, refused)

    def left(self, count: int) -> None:
        """The machine is known to have at most `count` jogs before it: what came before was answered, heard or not."""
        self._settle_answers()
        while len(self._sent) > count:
            self._sent.popleft()

    def cancel_now(self) -> None:
        """Throw away what is queued of jogs, from any thread, and wait for nothing; the link may be gone."""
        with suppress(LinkError):
            self.link.write(protocol.JOG_CANCEL)

    @property
    def round_trip(self) -> float:
        """What asking where the machine is has taken lately, s; 0 before it was asked."""
        recent = list(islice(reversed(self.reports), RECENT_REPORTS))
        trips = [report.round_trip for report in recent if report.round_trip < np.inf]
        return float(np.median(trips)) if trips else 0.0

    @property
    def shortest_round_trip(self) -> float:
        """What asking takes if nobody is busy, s: the least of a few hundred last reports; 0 before it was asked."""
        recent = islice(reversed(self.reports), LATEST_REPORTS)
        return min((report.round_trip for report in recent if report.round_trip > 0.0), default=0.0)

    def cancel_jog(self, within: float = 2.0) -> None:
        """Stop jogging, forget what is queued, wait until the machine stands."""
        self._settle_answers()
        self.link.write(protocol.JOG_CANCEL)
        patience = Patience(within)
        while (state := self.status().state) in ("Jog", "Run"):
            if patience.over():
                raise LinkError(f"{self.link.port}: still {state} {within:g} s after the jog was cancelled")
            time.sleep(0.1 * POLL)
        self._sent.clear()
        self._from = None
        self.check()

    def wait_idle(self, within: float) -> None:
        """Wait until every jog is answered and nothing moves; an operator's hold stops the clock.

        Raises:
            FingerError: a jog was refused.
            StoppedError, LinkError: as for `command`.
        """
        patience, idle = Patience(within), 0
        while (state := self.status().state) in ("Jog", "Run", "Hold", "Door") or self._sent:
            self.check()
            self._settle_answers()
            idle = idle + 1 if state == "Idle" else 0
            if idle > UNANSWERED:
                self._sent.clear()  # their answers were lost, or they were
                self._from = None
            self._wait_for_operator(patience)
            if patience.over():
                raise LinkError(f"{self.link.port}: the motion does not end within {within:g} s")
            time.sleep(0.1 * POLL)

    def unlock(self) -> None:
        """$X: leave the alarm state without moving; the position must be trusted."""
        self.alarm = None
        self._ask("$X")
        self.set_up()

    def home(self, within: float = 120.0) -> None:
        """$H: find machine zero. MOVES the machine."""
        self.alarm, self._way, self._from = None, None, None
        self.link.write(b"$H\n")
        restarts = self._restarts
        with self._news:
            self._answers.clear()
        # no status is answered while homing: only the port itself is watched
        self._wait(lambda: bool(self._answers), within, "the end of homing", restarts, None, stale=within)
        if (answer := self._answers.popleft()) != "ok":
            raise FingerError(f"{self.link.port}: homing was refused: {protocol.describe(answer)}")
        self.vouched, self.distrust = True, None
        self.set_up()

    # trust

    def vouch(self) -> None:
        """The user vouches that the machine was homed since it was switched on; holds until it restarts.

        Raises:
            FingerError: it restarted when the port was opened, or claims a place outside of its own travel.
        """
        if self._restarts:
            raise FingerError(
                f"{self.link.port}: the controller restarted when the port was opened, so nobody knows where it "
                "stands; home it (home = true), or break the reset line of the board (DTR to reset)"
            )
        here, (low, high) = self.position(), self.settings.bounds
        if ((here < low - OFF_THE_WAY) | (here > high + OFF_THE_WAY)).any():
            raise FingerError(
                f"{self.link.port}: the controller believes to stand at {np.round(1e3 * here, 3).tolist()} mm, outside "
                f"of its travel of {np.round(1e3 * low, 3).tolist()} to {np.round(1e3 * high, 3).tolist()} mm; home it"
            )
        self.vouched = True

    @property
    def doubts(self) -> list[str]:
        """What in the controller's settings takes away a net that a driver should not be without."""
        found = []
        if not self.settings.homing:
            found.append("$22=0: the machine has no homing, its position rests on your word alone")
        if not self.settings.soft_limits:
            found.append("$20=0: a line garbled on the way may lead out of the travel; set $20=1")
        if not int(self.settings.values.get(10, 1.0)) & 1:
            found.append("$10 is even: work positions are reported, which a changed work offset shifts; set $10=1")
        if np.abs(self.offset).max() > 0:
            found.append(f"work offset {np.round(1e3 * self.offset, 3).tolist()} mm: taken into account")
        return found

    def confirm_offset(self) -> None:
        """Read the work offset again. Raises StoppedError: it is another one than on connecting."""
        told = protocol.parse_offset(self._agreed("$#"), self._agreed("$G")) * self.settings.report_scale
        if np.abs(told - self.offset).max() > self.settings.resolution:
            self._lose_trust(OFFSET_CHANGED)
        self.check()

    def _lose_trust(self, reason: str) -> None:
        """In the reading thread: from now on nothing moves."""
        self.vouched, self.distrust = False, f"{self.link.port}: {reason}"
        self.halt(self.distrust)

    def _way_to(self, target: FloatArray, speed: float) -> FloatArray:
        """The way (3,), m, from where the last motion ends, as it is written in a line: what that rounds never adds up.

        Reports must lie in the box of the places between which it moves; it arrives when its speed says.
        """
        begun = self.resting_position() if self._from is None else self._from
        way = protocol.rounded(target - begun)
        with self._news:
            if self._anew or self._from is None or self._way is None:
                self._way, self._moves_until, self._anew = (begun, begun), -np.inf, False
            self._way = (np.minimum(self._way[0], target), np.maximum(self._way[1], target))
            lasts = float(np.linalg.norm(way)) / speed
            self._moves_until, self._from = max(self._moves_until, time.monotonic()) + lasts, begun + way
        return way

    def run_out(self) -> None:
        """Wait until all that it was told has ended, by the clock: for a machine that can be asked and stopped no more.

        One ramp comes on top of the ways at their speeds; an axis has reached its fastest by then.
        """
        ramp = self._ramp()
        ramp = ramp if np.isfinite(ramp) else 0.0
        while (left := self._moves_until + ramp - time.monotonic()) > 0.0:
            time.sleep(min(left, POLL))

    def _ramp(self) -> float:
        """Longest that it may take to reach the fastest speed, or to brake from it, s; inf where it does not say."""
        fastest = float(np.nanmax(np.append(self.settings.max_rate, 0.0)))
        slowest = float(np.nanmin(np.append(self.settings.acceleration, np.inf)))
        return fastest / slowest if 0.0 < slowest < np.inf and fastest > 0.0 else np.inf

    def _standing(self) -> bool:
        return bool(self.reports) and self.reports[-1].status.state == "Idle"

    def _is_plausible(self, status: Status) -> bool:
        """False for a report of a place where nothing sent it: garbled, or, if the next ones say so too, lost."""
        if self._way is None or self.distrust is not None:
            return True
        here = self.machine_position(status)
        if ((here >= self._way[0] - OFF_THE_WAY) & (here <= self._way[1] + OFF_THE_WAY)).all():
            self._off_the_way = 0
            return True
        self.implausible += 1
        together = self._seen_off is not None and np.abs(here - self._seen_off).max() <= OFF_TOGETHER
        self._off_the_way, self._seen_off = self._off_the_way + 1 if together else 1, here
        garbled_before = self.implausible > self._off_the_way
        if self._off_the_way >= (IF_GARBLED_BEFORE if garbled_before else OFF_THE_WAY_IN_A_ROW):
            self._lose_trust(
                f"the machine reports {np.round(1e3 * here, 3).tolist()} mm, where nothing sent it: it restarted, its "
                "zero was moved, or another program steers it; home it and run again with --resume"
            )
        return False

    def _hear_offset(self, offset: FloatArray) -> None:
        """A work offset that changes was garbled, or, if it is told again and again, set by somebody else."""
        known = self.offset
        if not self._offset_known or not self.vouched:
            self.offset = offset
        elif np.abs(offset - known).max() <= self.settings.resolution:
            self._new_offset = None
        else:
            again = self._new_offset is not None and np.array_equal(self._new_offset, offset)
            self._offset_told, self._new_offset = self._offset_told + 1 if again else 1, offset
            if self._offset_told >= (OFFSET_IF_GARBLED_BEFORE if self.garbled else OFFSET_IN_A_ROW):
                self._lose_trust(OFFSET_CHANGED)

    # stopping

    def halt(self, reason: str) -> None:
        """Feed hold and jog cancel, at once, from any thread; what waits is told the reason. Never raises."""
        self.stop_reason = self.stop_reason or reason
        with suppress(LinkError):
            self.link.write(protocol.HOLD + protocol.JOG_CANCEL)
        self._notify()

    def stop_if_killed(self) -> StopIfKilled:
        """While entered, the machine is stopped as by `halt` and `clear` if this program dies without a word."""
        ramp = self._ramp()
        stands = 2.0 * ramp if np.isfinite(ramp) else LONGEST_TO_A_STAND
        return StopIfKilled(self.link.handle, protocol.HOLD + protocol.JOG_CANCEL, stands, protocol.RESET)

    def clear(self, within: float = 3.0) -> bool:
        """After a halt: throw away what is queued and be ready again; True if the position is still known."""
        patience = Patience(within)
        status = self.status()
        while status.state in ("Run", "Jog", "Hold", "Home") and status.substate != 0 and not patience.over():
            if status.state != "Hold":
                self.link.write(protocol.HOLD)
            time.sleep(0.4 * POLL)
            status = self.status()
        before = self._restarts
        self._restart_expected = True
        self.link.write(protocol.RESET)
        with self._news:
            self._news.wait_for(lambda: self._restarts > before, timeout=RESTARTING)
        status = self.status()
        self._restart_expected = False
        self._restarts, self.stop_reason = before, self.distrust
        self._sent.clear()  # the reset threw away what was queued: it will not be answered
        if self.distrust is not None:
            return False
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
            waiting = self._silent or self._asked
            asked = waiting.popleft() if waiting else -np.inf
            status, round_trip = protocol.parse_status(line), now - (self._in_vain or asked)
            self._in_vain = None
            if status is None:
                self._unclear += 1
            elif self._is_plausible(status):
                self.reports.append(Report(now, status, round_trip))
                if status.offset is not None:
                    self._hear_offset(status.offset * self.settings.report_scale)
        elif line == "ok" or line.startswith("error:"):
            self._answers.append(line)
        elif line.startswith("ALARM:"):
            self.alarm = protocol.describe(line)
        elif line.startswith("Grbl") or line.endswith("for help]"):
            self._restarts += 1
            if not self._restart_expected:
                self._lose_trust(
                    "the controller restarted, so nobody knows where it stands; check its supply, home it and run "
                    "again with --resume"
                )
        else:
            self._feedback.append(line)
            self._unclear += not line.startswith(("[", "$", ">"))

    def _notify(self) -> None:
        with self._news:
            self._news.notify_all()

    def check(self) -> None:
        """Raise what stopped the machine, if anything did. Raises StoppedError, LinkError."""
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
        """Wait for news, asking for a status meanwhile, so that silence is noticed soon.

        A question that is not answered in the usual time was lost, or its answer was, and is asked again then: thirty
        bytes lost in a row are no silence. A machine that is silent for long is asked no oftener than others.
        """
        patience, silence, heard = Patience(within), Patience(stale), self.link.heard
        idle, seen, garbled = 0, len(self.reports) and self.reports[-1].at, self.garbled
        asked, told = time.monotonic(), True  # whether what was asked last has been answered
        while True:
            late = not told and time.monotonic() - self.link.heard < LONGEST_CONTROLLER_SILENCE
            late = late or self.garbled != garbled  # it may have been the answer
            again = self._again if late else max(0.0, asked + POLL - time.monotonic())
            with self._news:
                if self._news.wait_for(lambda: done() or self._trouble(restarts, alarm), timeout=again) and done():
                    return
            if self.alarm != alarm or self.stop_reason is not None or not self.link.is_open:
                self.check()
            if self._restarts != restarts:
                raise StoppedError(f"{self.link.port}: the controller restarted; home it or check its position")
            if self.reports and self.reports[-1].at != seen:
                seen = self.reports[-1].at
                idle = idle + 1 if self._standing() else 0
                if idle > UNANSWERED:
                    self._sent.clear()
                    raise _Unanswered(f"{self.link.port}: no answer while waiting for {what}; use a shielded cable")
            if self.link.heard != heard:
                heard, silence = self.link.heard, Patience(stale)
            self._wait_for_operator(patience)
            if patience.over() or silence.over():
                silent = f"{time.monotonic() - self.link.heard:.1f} s of silence while waiting for {what}"
                raise LinkError(
                    f"{self.link.port}: {silent}{patience.held_up}; check cable and power, reset the controller"
                )
            told = self._fresh(asked)
            if told and self.garbled == garbled and time.monotonic() - asked < POLL:
                continue
            asked, told = time.monotonic(), False
            self._request()

    def _trouble(self, restarts: int, alarm: str | None) -> bool:
        changed = self._restarts != restarts or self.alarm != alarm
        return changed or self.stop_reason is not None or not self.link.is_open


class _Unanswered(LinkError):
    """An idle controller that does not answer a line: the line, or its answer, was lost on the way."""
