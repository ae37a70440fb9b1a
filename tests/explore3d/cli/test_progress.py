"""Progress goes to stderr: bars on a terminal, a line a stage elsewhere, nothing if quiet."""

from __future__ import annotations

import sys

import pytest

from explore3d.cli.progress import shown


def work(quiet: bool = False) -> None:
    with shown(quiet) as progress:
        for stage in ("survey", "posterior"):
            for share in (0.0, 0.5, 1.0):
                progress(stage, share)


def test_a_log_file_gets_one_line_a_stage(capsys: pytest.CaptureFixture[str]) -> None:
    work()
    captured = capsys.readouterr()
    assert captured.err == "survey\nposterior\n"
    assert captured.out == ""


def test_no_signal_comes_between_a_stage_and_the_end_of_its_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is said of the signal would be glued to the stage's name."""
    written = list[str]()
    monkeypatch.setattr(sys.stderr, "write", lambda text: written.append(text) or len(text))
    work()
    assert [text for text in written if text] == ["survey\n", "posterior\n"]


def test_a_quiet_job_shows_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    work(quiet=True)
    captured = capsys.readouterr()
    assert captured.err == captured.out == ""


def test_a_terminal_gets_a_bar_a_stage_and_stdout_stays_clean(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    work()
    captured = capsys.readouterr()
    assert "survey" in captured.err
    assert "posterior" in captured.err
    assert "━" in captured.err
    assert captured.out == ""


def test_an_error_in_the_job_is_not_hidden(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with pytest.raises(ZeroDivisionError), shown() as progress:
        progress("survey", 1 / 0)
