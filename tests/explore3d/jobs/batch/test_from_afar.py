"""Logs at addresses: looked into by ranges, fetched by ranges, and what is no log of ours."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from in_process import explore3d_main
from range_server import served
from sample_logs import write_log
from small_profiles import write_profile

from explore3d import UserError
from explore3d.jobs.batch.from_afar import look_from_afar
from explore3d.jobs.batch.places import BLOCK_BYTES, local, sha256_of
from explore3d.log.own.reader import digest, read_log
from explore3d.log.own.writer import LogWriter

pytest.importorskip("aiohttp")


def test_a_log_at_an_address_is_looked_into_for_the_kilobytes_of_its_plan(tmp_path: Path) -> None:
    log = write_log(tmp_path / "log.mcap", moves=8, count=20_000)
    with served(tmp_path) as server:
        far = look_from_afar(f"{server.address}/log.mcap")
    assert far is not None and far.size == log.stat().st_size > 2e6
    assert far.samples == 160_000 and far.moves == {"sweep": 8, "travel": 8} and far.tip_radius == 0.01
    assert far.scene == "seed = 1\n" and far.ended == "closed"
    # what the server handed out, not what the reader says it asked for
    assert sum(server.answers) < 0.15 * far.size and max(server.answers) < 0.1 * far.size


def test_the_command_says_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_log(tmp_path / "log.mcap", moves=3, count=100)
    write_profile(tmp_path / "scan.csv")
    with served(tmp_path) as server:
        assert explore3d_main(monkeypatch, "inspect", f"{server.address}/log.mcap", "--json") == 0
        assert json.loads(capsys.readouterr().out)["moves"] == {"sweep": 3, "travel": 3}
        assert explore3d_main(monkeypatch, "inspect", f"{server.address}/scan.csv", "--tip-radius", "2 um") == 0
        assert f"{server.address}/scan.csv: a table of numbers" in capsys.readouterr().out
        assert explore3d_main(monkeypatch, "inspect", f"{server.address}/absent.mcap") == 2
        error = capsys.readouterr().err.splitlines()
    assert len(error) == 1 and "/absent.mcap: cannot be opened" in error[0]


def test_a_log_that_was_never_closed_is_no_log_by_ranges(tmp_path: Path) -> None:
    log = write_log(tmp_path / "log.mcap", moves=3, count=2000)
    log.write_bytes(log.read_bytes()[:-3000])
    write_profile(tmp_path / "scan.csv")
    with served(tmp_path) as server:
        for name in ("log.mcap", "scan.csv"):
            assert look_from_afar(f"{server.address}/{name}") is None


def test_a_damaged_index_is_one_line(tmp_path: Path) -> None:
    log = write_log(tmp_path / "log.mcap", moves=3, count=2000)
    content = bytearray(log.read_bytes())
    content[-37:-20] = b"\xff" * 17  # the footer's place of the summary
    log.write_bytes(content)
    with served(tmp_path) as server, pytest.raises(UserError, match=r"log\.mcap: cannot be read by ranges"):
        look_from_afar(f"{server.address}/log.mcap")


def test_a_log_of_a_tip_without_size_is_refused_from_afar_and_here(tmp_path: Path) -> None:
    LogWriter(tmp_path / "log.mcap", tip_radius=0.0).close()
    with served(tmp_path) as server, pytest.raises(UserError, match=r"field tip_radius is 0 m"):
        look_from_afar(f"{server.address}/log.mcap")
    with pytest.raises(UserError, match=r"field tip_radius is 0 m"):
        read_log(tmp_path / "log.mcap")


def test_a_log_is_fetched_in_ranges_and_is_the_same(tmp_path: Path) -> None:
    content = bytes(range(256)) * (BLOCK_BYTES // 64)
    (tmp_path / "large.bin").write_bytes(content)
    with served(tmp_path) as server:
        address = f"{server.address}/large.bin"
        with local(address) as path:
            assert path.read_bytes() == content
        assert max(server.answers) <= 2 * BLOCK_BYTES and len(server.answers) >= 2
        assert sha256_of(address) == digest(tmp_path / "large.bin")
