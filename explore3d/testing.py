"""Conformance: does a finger keep its contract, and does it end well when its device fails? For anybody's finger.

Describe your finger on its test bench as a `Rig`, and check every case:

    @pytest.mark.parametrize("case", CASES)
    def test_it_conforms(case: str) -> None:
        check(case, rig)

`rig` is called for every case and gives a context with a new device. The cases are what a finger owes its users
(CONTRACT), and each fault of FAULTS struck early, midway and late in a sweep. A case that the rig cannot make is told
apart from one that was passed: `check` returns False.
"""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np

from hw import THROUGH_SPACE, Finger, FingerError, Move
from mapping import FloatArray, Trace

# A finger gives up this soon after its device failed, and lets go this soon when it is left, s
LONGEST_ENDING = 5.0
# An undisturbed sweep of the rig ends in this time, s
LONGEST_UNDISTURBED = 60.0
# The true force may exceed the finger's own limit by this share: braking, one late sample
FORCE_SLACK = 1.1
# So long after the finger was left nothing may move any more, s; and what is no motion, m
WATCHED, STILLNESS = 0.3, 1e-9
# When a fault strikes, in shares of the undisturbed sweep's time
STRIKES = {"early": 0.15, "midway": 0.5, "late": 0.85}
# What can happen to a device, and whether a finger may ever go on after it as if nothing had been
FAULTS = {
    "gone": ("the connection breaks", False),
    "silent": ("the device answers no more", False),
    "stopped": ("emergency stop, or an alarm", False),
    "restarted": ("the device restarts, and does not know where it stands", False),
    "dead": ("what should feel the body feels nothing", True),
    "frozen": ("what feels the body says the same for ever", True),
    "garbled": ("what the device reports is nonsense now and then", True),
}


@dataclass(frozen=True, eq=False)
class Rig:
    """A finger over a body that is known, on a device that can be made to fail.

    Args:
        open: a new finger for the device, allowed to move, not yet entered.
        sweep: a sweep that touches the body, at most a minute long.
        off: how far centres (N, 3), m, lie off the true trace: (N,) m.
        tolerance: how far they may, m.
        travelled: way that the device has made so far, m; None: it cannot tell.
        force: largest true force on the tip so far, N; None: it cannot tell.
        most_force: that may press on the tip, N.
        faults: by the names of FAULTS: makes the device fail from now on; called from another thread.
    """

    open: Callable[[], Finger]
    sweep: Move
    off: Callable[[FloatArray], FloatArray]
    tolerance: float
    travelled: Callable[[], float] | None = None
    force: Callable[[], float] | None = None
    most_force: float | None = None
    faults: Mapping[str, Callable[[], None]] = field(default_factory=dict)


R = TypeVar("R")


class NonconformityError(AssertionError):
    """What a finger does not do as it should, in one sentence."""


def check(case: str, rig: Callable[[], AbstractContextManager[Rig]]) -> bool:
    """Carry out one of CASES; False if the rig cannot make that fault.

    Raises:
        NonconformityError: the finger does not conform.
    """
    with rig() as bench:
        if case in CONTRACT:
            CONTRACT[case](bench)
            return True
        fault, _, moment = case.partition(", ")
        if fault not in bench.faults:
            return False
        _ends_well(bench, fault, STRIKES[moment], rig)
        return True


def _demand(holds: bool, otherwise: str) -> None:
    if not holds:
        raise NonconformityError(otherwise)


# the contract


def _says_what_it_is(rig: Rig) -> None:
    with rig.open() as finger:
        _demand(isinstance(finger, Finger), f"{type(finger).__name__} lacks a part of hw.Finger")
        space = finger.workspace
        for name, corner in (("low", space.low), ("high", space.high)):
            _demand(np.shape(corner) == (3,) and bool(np.isfinite(corner).all()), f"workspace.{name} is no finite (3,)")
        _demand(bool((space.low < space.high).all()), "workspace.low does not lie below workspace.high")
        for name, value in (
            ("workspace.max_speed", space.max_speed),
            ("workspace.max_force", space.max_force),
            ("tip_radius", finger.tip_radius),
        ):
            _demand(0 < value < np.inf, f"{name} is not positive and finite: {value}")
        try:
            told = json.loads(json.dumps(finger.info, allow_nan=False))
        except (TypeError, ValueError) as error:
            raise NonconformityError(f"info does not consist of JSON values: {error}") from error
        _demand(isinstance(told.get("kind"), str), "info does not say its kind")


def _moves_nothing_unasked(rig: Rig) -> None:
    before = _way(rig)
    with rig.open():
        time.sleep(WATCHED)
    _demand(_way(rig) - before <= STILLNESS, "connecting and leaving moved the device")


def _feels_the_body(rig: Rig) -> None:
    with rig.open() as finger:
        first, second = finger.execute(rig.sweep), finger.execute(rig.sweep)
    for trace in (first, second):
        _demand(isinstance(trace, Trace) and len(trace) > 0, "a sweep over the body felt nothing")
        _demand(bool(np.isfinite(trace.centers).all()), "centres are not finite")
        _demand(bool((np.diff(trace.t) >= 0).all()), "the times of a sweep do not rise")
        _demand(len(np.unique(trace.sweep)) == 1, "one sweep has several numbers")
        _demand(trace.tip_radius == finger.tip_radius, "the trace has another tip radius than the finger")
        _right(rig, trace)
    _demand(first.sweep[0] != second.sweep[0], "two sweeps have one number")
    _demand(first.t[-1] <= second.t[0], "the second sweep begins before the first one ends")


def _feels_nothing_on_its_way(rig: Rig) -> None:
    above = rig.sweep.path[:1] - 2e-3 * rig.sweep.approach[:1]
    with rig.open() as finger:
        for purpose in THROUGH_SPACE:
            felt = finger.execute(replace(rig.sweep, path=above, approach=rig.sweep.approach[0], purpose=purpose))
            _demand(len(felt) == 0, f"a {purpose} gave samples")


def _refuses_what_exceeds(rig: Rig) -> None:
    with rig.open() as finger:
        space, sweep = finger.workspace, rig.sweep
        outside = sweep.path + (space.high - space.low + 1.0)
        before = _way(rig)
        for what, move in (
            ("leaves the workspace", replace(sweep, path=outside)),
            ("is too fast", replace(sweep, speed=10 * space.max_speed)),
            ("asks for too much force", replace(sweep, force=10 * space.max_force)),
        ):
            try:
                finger.execute(move)
            except FingerError as error:
                _readable(error)
            else:
                raise NonconformityError(f"a move that {what} is not refused by a FingerError")
        _demand(_way(rig) - before <= STILLNESS, "a move that is refused moves the device all the same")
        _demand(len(finger.execute(sweep)) > 0, "after a refusal nothing is felt any more")


def _lets_go(rig: Rig) -> None:
    for _ in range(2):
        finger = rig.open()
        with suppress(KeyboardInterrupt), finger:
            finger.execute(rig.sweep)
            raise KeyboardInterrupt
        _stands_still(rig)
        before = _way(rig)
        with suppress(FingerError):
            finger.execute(rig.sweep)
        _demand(_way(rig) - before <= STILLNESS, "a finger that was left still moves the device when it is asked to")


def _ends_well(rig: Rig, fault: str, share: float, anew: Callable[[], AbstractContextManager[Rig]]) -> None:
    """The device fails in the midst of a sweep: the finger says so, soon, and nothing wrong is kept."""
    with anew() as other, other.open() as finger:
        begun = time.monotonic()
        finger.execute(other.sweep)
        lasts = time.monotonic() - begun
    finger, most = rig.open(), lasts + LONGEST_ENDING
    _aside(finger.__enter__, LONGEST_UNDISTURBED, "connecting")
    kept: list[Trace] = []
    if hasattr(finger, "notice"):
        finger.notice = kept.append
    timer = threading.Timer(share * lasts, rig.faults[fault])
    timer.start()
    error = None
    for _ in range(2):  # a sweep that is cut short gives what it has; the next one must not begin as if nothing was
        try:
            kept.append(_aside(lambda: finger.execute(rig.sweep), most, f"a sweep while {_told(fault)}"))
        except FingerError as found:
            error = found
            break
        timer.join()  # a busy host may strike too late for the first sweep, never for the second one
    timer.join()
    _aside(lambda: finger.__exit__(None, None, None), LONGEST_ENDING, f"leaving while {_told(fault)}")
    for trace in kept:
        _right(rig, trace)
    _demand(error is not None or FAULTS[fault][1], f"{_told(fault)}, and two sweeps later no FingerError has said so")
    if error is not None:
        _readable(error)
    _stands_still(rig)


# what they share


def _aside(what: Callable[[], R], within: float, name: str) -> R:
    """Carry out what may hang in a thread of its own, so that a hang is found and told."""
    ended: list[R] = []
    failed: list[BaseException] = []

    def carry_out() -> None:
        try:
            ended.append(what())
        except BaseException as error:  # handed to whoever waits for it
            failed.append(error)

    thread = threading.Thread(target=carry_out, daemon=True)
    thread.start()
    thread.join(within)
    _demand(not thread.is_alive(), f"{name} does not end within {within:.0f} s")
    if failed:
        raise failed[0]
    return ended[0]


def _told(fault: str) -> str:
    return f"{FAULTS[fault][0]} ({fault})"


def _readable(error: FingerError) -> None:
    text = str(error)
    _demand(bool(text.strip()) and "\n" not in text, f"a message should be one line that says what to do: {text!r}")


def _right(rig: Rig, trace: Trace) -> None:
    """Every sample lies where the ball's centre was, and the tip was not pressed harder than the finger may."""
    if len(trace):
        worst = float(np.abs(rig.off(trace.centers)).max())
        _demand(
            worst <= rig.tolerance, f"a sample lies {1e6 * worst:.1f} um off; {1e6 * rig.tolerance:.1f} um are allowed"
        )


def _way(rig: Rig) -> float:
    return 0.0 if rig.travelled is None else rig.travelled()


def _stands_still(rig: Rig) -> None:
    before = _way(rig)
    time.sleep(WATCHED)
    _demand(_way(rig) - before <= STILLNESS, "the device still moves after the finger was left")
    if rig.force is not None and rig.most_force is not None:
        strongest = rig.force()
        _demand(
            strongest <= FORCE_SLACK * rig.most_force,
            f"the tip was pressed with {strongest:.2f} N; at most {rig.most_force:g} N are allowed",
        )


CONTRACT: dict[str, Callable[[Rig], None]] = {
    "says what it is": _says_what_it_is,
    "moves nothing unasked": _moves_nothing_unasked,
    "feels the body": _feels_the_body,
    "feels nothing on its way": _feels_nothing_on_its_way,
    "refuses what exceeds its limits": _refuses_what_exceeds,
    "lets go": _lets_go,
}
CASES = (*CONTRACT, *(f"{fault}, {moment}" for fault in FAULTS for moment in STRIKES))
