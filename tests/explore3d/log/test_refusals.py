"""What is no log, or cannot become one, is refused in one line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from sample_logs import MOVE, RADIUS, trace_of, write_log
from small_profiles import TIP, write_profile

from explore3d.errors import UserError
from explore3d.jobs.analyze import analyze
from explore3d.log.load import load_logs
from explore3d.log.own import format as log_format
from explore3d.log.own.reader import iter_log, read_log
from explore3d.log.own.writer import LogWriter
from mapping.trace import Trace


def one_line(error: pytest.ExceptionInfo[UserError], *parts: str) -> None:
    assert "\n" not in str(error.value)
    for part in parts:
        assert part in str(error.value)


def test_a_log_with_no_samples_is_refused(tmp_path: Path) -> None:
    with LogWriter(tmp_path / "log.mcap", tip_radius=RADIUS) as log:
        log.write(MOVE, trace_of(0, 0))
    for read in (read_log, lambda path: list(iter_log(path)), lambda path: load_logs([path])):
        with pytest.raises(UserError) as error:
            read(tmp_path / "log.mcap")
        one_line(error, "log.mcap", "samples")


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.mcap", b"", "no intact message"),
        ("a.mcap", b"\x89PNG\r\n\x1a\n", "does not begin"),
        ("a.png", b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "PNG image"),
        ("a.mcap", log_format.MAGIC, "no intact message"),
        ("a.bin", bytes(range(256)), "binary"),
        ("a.csv", b"", "empty"),
    ],
)
def test_files_that_are_no_logs_are_refused_in_one_line(tmp_path: Path, name: str, content: bytes, said: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(UserError) as error:
        load_logs([tmp_path / name], tip_radius="1 mm")
    one_line(error, str(tmp_path / name), said)


def test_a_missing_log_and_a_folder_without_one_are_refused(tmp_path: Path) -> None:
    for path in (tmp_path / "none.mcap", tmp_path):
        with pytest.raises(UserError) as error:
            load_logs([path])
        one_line(error, str(path))


def test_the_folder_of_what_was_made_from_a_table_says_from_which(tmp_path: Path) -> None:
    path = write_profile(tmp_path / "a.csv")
    analyze(path, tmp_path / "out", tip_radius=TIP, quick=True)
    with pytest.raises(UserError) as error:
        load_logs([tmp_path / "out"])
    one_line(error, f"explore3d analyze {path}", "give the recording that it was made from")
    record = json.loads((tmp_path / "out" / "session.json").read_text())
    del record["command"]  # as of older versions
    (tmp_path / "out" / "session.json").write_text(json.dumps(record))
    with pytest.raises(UserError) as error:
        load_logs([tmp_path / "out"])
    one_line(error, "what it holds is what explore3d analyze made of a file elsewhere", "give the recording")


def test_a_log_of_somebody_else_is_refused(tmp_path: Path) -> None:
    from mcap.writer import Writer

    with (tmp_path / "other.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("x", "jsonschema", b"{}")
        writer.add_message(writer.register_channel("/x", "json", schema), 0, b"{}", 0)
        writer.finish()
    with pytest.raises(UserError) as error:
        read_log(tmp_path / "other.mcap")
    one_line(error, "other.mcap", "explore3d log")


def test_a_log_of_a_later_format_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(log_format, "VERSION", "explore3d/log/9")
    path = write_log(tmp_path / "log.mcap", moves=1)
    monkeypatch.undo()
    with pytest.raises(UserError) as error:
        read_log(path)
    one_line(error, "schema", "explore3d/log/9", log_format.VERSION)


def test_another_tip_radius_is_refused_in_writing_reading_and_merging(tmp_path: Path) -> None:
    with LogWriter(tmp_path / "a.mcap", tip_radius=0.02) as log:
        with pytest.raises(UserError, match=r"0\.02"):
            log.write(MOVE, trace_of(0, 3))
        log.write(MOVE, Trace(np.arange(2), np.zeros((2, 3)), np.zeros(2, dtype=int), 0.02))
    with pytest.raises(UserError, match=r"0\.03 m is asked for, but the log states 0\.02"):
        read_log(tmp_path / "a.mcap", tip_radius=0.03)
    with pytest.raises(UserError, match="tip_radius"):
        read_log([write_log(tmp_path / "b.mcap", moves=1), tmp_path / "a.mcap"])


def test_an_existing_log_is_never_overwritten(tmp_path: Path) -> None:
    (tmp_path / "log.mcap").write_text("precious")
    with pytest.raises(UserError, match=r"log\.mcap"):
        LogWriter(tmp_path / "log.mcap", tip_radius=RADIUS)
    assert (tmp_path / "log.mcap").read_text() == "precious"


def test_a_sweep_number_beyond_32_bits_is_refused(tmp_path: Path) -> None:
    with LogWriter(tmp_path / "log.mcap", tip_radius=RADIUS) as log, pytest.raises(UserError, match="sweep"):
        log.write(MOVE, trace_of(0, 3, sweep=2**31))


def test_values_that_json_cannot_keep_are_refused(tmp_path: Path) -> None:
    with LogWriter(tmp_path / "log.mcap", tip_radius=RADIUS) as log:
        with pytest.raises(TypeError, match="JSON"):
            log.event("x", {"value": object()})
        with pytest.raises(ValueError, match="JSON"):
            log.event("x", {"value": float("nan")})


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Path, "open", lambda self, mode: open("/dev/full", "wb"))  # noqa: SIM115
    with pytest.raises(UserError, match="cannot write the log: No space left"):
        LogWriter(tmp_path / "log.mcap", tip_radius=RADIUS)


# --- several logs ---------------------------------------------------------------------------------------
