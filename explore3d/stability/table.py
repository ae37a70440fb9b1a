"""Stability: what becomes of the digits at the extremes, one row for each named case.

A case states what was asked, what came out, and what it may lose: the condition number of the question times the
rounding of its input, or a tolerance that the method states. Losing more is a failure. Cases run in a process of
their own, so that one which kills it, or takes too long, is a row of the table as well.
"""

from __future__ import annotations

import csv
import importlib
import io
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, TimeoutError
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from math import isfinite, isnan, log10, nan
from multiprocessing import get_context
from time import perf_counter
from typing import Any

from explore3d import count_text

EPS = 2.0**-52
# Roundings that add up along a computation: a case may lose so many units in the last place.
SLACK = 64.0
MOST_CASE_SECONDS = 60.0
# the files of the cases, in the order of the table, and the list in each
MODULES = {
    "closed_forms": "CLOSED_FORM_CASES",
    "contact": "CONTACT_CASES",
    "curvature": "CURVATURE_CASES",
    "meshes": "MESH_CASES",
    "dynamics": "DYNAMICS_CASES",
    "detection": "DETECTION_CASES",
    "posterior": "POSTERIOR_CASES",
}
STABILITY_COLUMNS = (
    "group",
    "case",
    "asked",
    "found",
    "digits",
    "allowed",
    "condition",
    "paper",
    "reason",
    "seconds",
    "verdict",
)


@dataclass(frozen=True)
class Answer:
    """What came of a case.

    Args:
        found: in words.
        error: relative error against the reference; NaN where the case is about an outcome, not a number.
        condition: relative condition number of the question.
        floor: relative error that the method states beside rounding, for the reason given.
        reason: why so many digits may go, or what decides the outcome.
        holds: of an outcome: is it what it must be?
        paper: relative error of the formula as the paper or a textbook prints it; NaN if there is none.
    """

    found: str
    error: float = nan
    condition: float = 1.0
    floor: float = 0.0
    reason: str = ""
    holds: bool = True
    paper: float = nan


@dataclass(frozen=True)
class Case:
    """A question at an extreme: `run` answers it."""

    group: str
    name: str
    asked: str
    run: Callable[[], Answer]


@dataclass(frozen=True)
class Row:
    """A case with its answer, seconds that it took, and "" or what went wrong."""

    group: str
    name: str
    asked: str
    answer: Answer
    seconds: float
    fault: str = ""

    @property
    def allowed(self) -> float:
        """Largest relative error that the condition number, or the method's stated tolerance, explains."""
        return max(SLACK * EPS * self.answer.condition, self.answer.floor)

    @property
    def passed(self) -> bool:
        """True unless it crashed, took too long, or lost more than is explained."""
        numeric = isnan(self.answer.error) or self.answer.error <= self.allowed
        return not self.fault and self.answer.holds and numeric and self.seconds <= MOST_CASE_SECONDS

    def record(self) -> dict[str, Any]:
        """As JSON values; errors of an outcome, which is no number, are None."""
        answer = self.answer
        numbers = {"error": answer.error, "allowed": self.allowed, "condition": answer.condition, "paper": answer.paper}
        return {
            "group": self.group,
            "name": self.name,
            "asked": self.asked,
            "found": self.fault or answer.found,
            **{name: value if isfinite(value) else None for name, value in numbers.items()},
            "reason": answer.reason,
            "seconds": self.seconds,
            "passed": self.passed,
        }


def cases() -> dict[str, Case]:
    """Every case by its full name, in the order of the table."""
    found: dict[str, Case] = {}
    for module, listed in MODULES.items():
        for case in getattr(importlib.import_module(f"explore3d.stability.{module}"), listed):
            found[f"{case.group}: {case.name}"] = case
    return found


def digits(error: float) -> float:
    """Correct decimal digits of a number with that relative error, 0 to 16."""
    return 16.0 if error == 0 else min(16.0, max(0.0, -log10(error)))


def stability(names: Sequence[str] | None = None, seconds: float = MOST_CASE_SECONDS) -> Iterator[Row]:
    """Run the cases (None: all) one after the other; a row each as it is done."""
    known = cases()
    pool = _pool()
    try:
        for name in list(known) if names is None else names:
            case, begin, fault = known[name], perf_counter(), ""
            answer, spent = Answer(""), 0.0
            try:
                answer, spent = pool.submit(answer_of, name).result(timeout=seconds + 30.0)
            except BrokenProcessPool:
                fault = "the process died"
            except TimeoutError:
                fault = f"no answer after {seconds:.0f} s"
            except Exception as error:  # whatever a case raises is its row, not the end of the table
                fault = f"{type(error).__name__}: {error}"
            if fault:
                spent = perf_counter() - begin
                _kill(pool)
                pool = _pool()
            yield Row(case.group, case.name, case.asked, answer, spent, fault)
    finally:
        _kill(pool)


def answer_of(name: str) -> tuple[Answer, float]:
    """The answer of a case and the seconds that it took, imports and compiling not counted twice."""
    case = cases()[name]
    begin = perf_counter()
    return case.run(), perf_counter() - begin


def cells(row: Row) -> tuple[str, ...]:
    """The row as text, in the order of STABILITY_COLUMNS."""
    answer, numeric = row.answer, not isnan(row.answer.error)
    return (
        row.group,
        row.name,
        row.asked,
        row.fault or answer.found,
        f"{digits(answer.error):.1f}" if numeric else "",
        f"{digits(min(row.allowed, 1.0)):.1f}" if numeric else "",
        f"{answer.condition:.1e}" if numeric else "",
        "" if isnan(answer.paper) else f"{digits(answer.paper):.1f}",
        answer.reason,
        f"{row.seconds:.2f}",
        "ok" if row.passed else "FAILS",
    )


def as_csv(rows: Sequence[Row]) -> str:
    """The table as CSV."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(STABILITY_COLUMNS)
    writer.writerows(cells(row) for row in rows)
    return text.getvalue()


def summary(rows: Sequence[Row]) -> str:
    """The table in one line."""
    failed = [f"{row.group}: {row.name}" for row in rows if not row.passed]
    crashed = sum(row.fault.startswith("the process died") for row in rows)
    slowest = max((row.seconds for row in rows), default=0.0)
    numeric = [row for row in rows if not row.fault and not isnan(row.answer.error)]
    spare = min((digits(row.answer.error) - digits(min(row.allowed, 1.0)) for row in numeric), default=nan)
    closest = "" if isnan(spare) else f" (closest: {spare:.1f} digits to spare)"
    end = f"fails: {'; '.join(failed)}" if failed else f"none fails{closest}"
    counts = f"{count_text(len(rows), 'case')}, {len(failed)} failed, {crashed} crashed"
    return f"stability: {counts}, slowest {slowest:.1f} s; {end}"


def _pool() -> ProcessPoolExecutor:
    return ProcessPoolExecutor(1, mp_context=get_context("spawn"))


def _kill(pool: ProcessPoolExecutor) -> None:
    for process in list((pool._processes or {}).values()):
        process.kill()
    pool.shutdown(wait=True, cancel_futures=True)
