"""The stability table: it counts digits rightly, it can fail, and its quick cases hold."""

from __future__ import annotations

from decimal import Decimal
from math import inf, nan

import pytest
from typer.testing import CliRunner

from explore3d.cli.main import command_line
from explore3d.stability import table as table
from explore3d.stability.exact_decimal import arctan, condition, exact, relative_error
from explore3d.stability.table import EPS, SLACK, Answer, Case, Row, cells, digits, summary


def row(answer: Answer, seconds: float = 0.1, fault: str = "") -> Row:
    return Row("group", "case", "asked", answer, seconds, fault)


def test_digits_are_those_of_the_relative_error():
    assert digits(1e-7) == pytest.approx(7.0)
    assert digits(0.0) == 16.0
    assert digits(3.0) == 0.0


def test_a_case_may_lose_what_its_condition_number_explains_and_no_more():
    assert row(Answer("", error=SLACK * EPS * 1e6, condition=1e6)).passed
    assert not row(Answer("", error=2 * SLACK * EPS * 1e6, condition=1e6)).passed
    assert row(Answer("", error=1e-9, floor=1e-8)).passed
    assert not row(Answer("", error=inf, condition=1e6)).passed
    assert not row(Answer("", error=nan, holds=False)).passed
    assert not row(Answer(""), seconds=61.0).passed
    assert not row(Answer(""), fault="the process died").passed
    assert "closest" not in summary([row(Answer("an outcome"))])
    assert "(closest: 2.2 digits to spare)" in summary([row(Answer("", error=0.0)), row(Answer("an outcome"))])
    assert "fails: group: case" in summary([row(Answer("", error=1.0))])


def test_condition_numbers_are_those_of_the_formula():
    assert condition(lambda x: x * x, [3.0]) == pytest.approx(2.0)
    assert condition(lambda a, b: a - b, [1.0, 1.0 - 1e-6]) == pytest.approx(2e6, rel=1e-3)


def test_the_decimal_reference_has_its_digits():
    quarter_pi = Decimal("0.78539816339744830961566084581987572104929234984378")
    assert abs(exact(lambda x: arctan(x) - quarter_pi, [1.0])) < Decimal("1e-49")
    assert relative_error(1.5, Decimal(1)) == 0.5


def test_a_case_that_kills_its_process_is_a_row_and_the_next_one_runs(monkeypatch):
    killer = Case("group", "killer", "", lambda: Answer(""))
    monkeypatch.setattr(table, "answer_of", _die)
    monkeypatch.setattr(table, "cases", lambda: {"group: killer": killer, "group: again": killer})
    rows = list(table.stability())
    assert [r.fault for r in rows] == ["the process died"] * 2
    assert "2 crashed" in summary(rows)


def _die(name: str) -> None:
    import os

    os._exit(1)


@pytest.mark.parametrize(
    "group", ["closed forms", pytest.param("contact", marks=pytest.mark.slow), "detection: unit of 1000 m"]
)
def test_no_quick_case_fails(group):
    for name, case in table.cases().items():
        if name.startswith(group):
            made = Row(case.group, case.name, case.asked, case.run(), 0.0)
            assert made.passed, cells(made)


def test_the_command_writes_page_and_table_and_ends_with_a_summary(tmp_path):
    result = CliRunner().invoke(command_line(), ["stability", "--only", "kink beside", "--out", str(tmp_path)])
    assert result.exit_code == 0, result.output
    assert result.output.splitlines()[-1].startswith("stability: 1 case, 0 failed")
    assert "printed form" in (tmp_path / "stability.html").read_text()
    assert len((tmp_path / "stability.csv").read_text().splitlines()) == 2


@pytest.mark.slow
def test_no_case_fails():
    rows = list(table.stability())
    assert all(r.passed for r in rows), summary(rows)
