"""More than two hundred bad inputs over all commands: one line, exit status 2, nothing moved, nothing left behind."""

from __future__ import annotations

import re
import sys
import time
from pathlib import Path

import pytest
from bad_inputs import BAD, Bad
from scene_files import write_scene_file

from explore3d.cli.main import main
from hw import SimulatedFinger

SECONDS = 5.0  # of computing, until a refusal
STAGE = re.compile(r"[a-z ]+")  # a stage that began is named on a line of its own
EVERY_SO_MANY = 20  # of them by default, the others with make test-all
# A wrong call of the command line itself is answered by its usage, three lines above the one that says what is wrong
USAGE = "Usage: "


def refused(bad: Bad, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Give the input to the program, and check how it is refused."""

    def moved(*_: object) -> None:
        raise AssertionError("something moved")

    folder.mkdir()
    for name, content in bad.files:
        if isinstance(content, str) and name.endswith(".toml"):
            write_scene_file(folder / name, content)
        else:
            (folder / name).write_bytes(content.encode() if isinstance(content, str) else content)
    if bad.make is not None:
        bad.make(folder)
    before = sorted(folder.rglob("*"))
    monkeypatch.setattr(SimulatedFinger, "execute", moved)
    monkeypatch.setattr(sys, "argv", ["explore3d", *(word.replace("{}", str(folder)) for word in bad.words)])
    begun = time.process_time()
    with pytest.raises(SystemExit) as end:
        main()
    taken = time.process_time() - begun
    said = capsys.readouterr()
    *above, last = said.err.splitlines()
    assert end.value.code == 2, (bad.name, last)
    assert not said.out, bad.name
    for words in bad.said:
        assert words.replace("{}", str(folder)) in last, (bad.name, last)
    if not said.err.startswith(USAGE):
        assert last.startswith("explore3d: ") and all(STAGE.fullmatch(line) for line in above), (bad.name, said.err)
    assert sorted(folder.rglob("*")) == before, bad.name
    assert taken < SECONDS, (bad.name, taken)


def test_there_are_more_than_two_hundred_over_all_commands() -> None:
    assert len(BAD) > 200 and len({(bad.name, bad.files, bad.said) for bad in BAD}) == len(BAD)
    commands = {bad.words[0] for bad in BAD}
    every = {"run", "plan", "analyze", "inspect", "merge", "calibrate", "selftest", "reprobe", "emulate", "examples"}
    assert commands >= every | {"init", "figures", "stability", "doctor", "bench"}


def test_some_bad_inputs_are_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for number, bad in enumerate(BAD[::EVERY_SO_MANY]):
        refused(bad, tmp_path / str(number), monkeypatch, capsys)


@pytest.mark.slow
def test_every_bad_input_is_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for number, bad in enumerate(BAD):
        refused(bad, tmp_path / str(number), monkeypatch, capsys)
