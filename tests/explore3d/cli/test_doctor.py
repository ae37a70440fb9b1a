"""The doctor names what is missing, what it is needed for, and what to do."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import pytest

import explore3d.bench.display
import explore3d.jobs.batch
from explore3d.cli import doctor
from explore3d.cli.doctor import STATES, examine
from explore3d.jobs.machines.emulate import Emulation
from hw.emulated.pty_server import PtyServer


def by_subject(monkeypatch: pytest.MonkeyPatch, subject: str) -> doctor.Check:
    return next(check for check in examine() if check.subject == subject)


def test_every_check_says_what_it_is_needed_for() -> None:
    checks = examine()
    assert {"Python", "open3d", "emcee", "kernel cache"} <= {check.subject for check in checks}
    assert all(check.state in STATES and check.found and check.needed_for for check in checks)
    assert all(check.remedy for check in checks if check.state == "missing")


def test_a_missing_package_is_named_with_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(doctor.REQUIRED_PACKAGES, "no-such-package", ("no_such_package", "the test"))
    check = by_subject(monkeypatch, "no-such-package")
    assert (check.state, check.found, check.remedy) == ("missing", "not installed", "make setup")


def test_a_package_that_does_not_load_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(doctor.REQUIRED_PACKAGES, "emcee", ("emcee.no_such_module", "the test"))
    check = by_subject(monkeypatch, "emcee")
    assert check.state == "missing"
    assert "does not load: ModuleNotFoundError" in check.found


def test_a_missing_system_library_of_open3d_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails() -> None:
        raise ImportError("libGL.so.1: cannot open shared object file")

    monkeypatch.setattr(doctor, "open3d", fails)
    check = by_subject(monkeypatch, "open3d")
    assert check.state == "missing"
    assert "libGL.so.1" in check.found
    assert "make setup" in check.remedy


def test_serial_ports_are_listed_with_their_permission(
    monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory
) -> None:
    from serial.tools import list_ports

    mine = tmp_path_factory.mktemp("dev") / "ttyACM0"
    mine.write_text("")
    monkeypatch.setattr(list_ports, "comports", lambda: [_Port(str(mine), "a finger"), _Port("/no/tty", "")])
    assert by_subject(monkeypatch, str(mine)).state == "ok"
    refused = by_subject(monkeypatch, "/no/tty")
    assert refused.state == "note"
    assert "no permission" in refused.found
    assert "dialout" in refused.remedy


class _Port(str):
    """A port as pyserial lists it: sortable, with device and description."""

    description: str

    def __new__(cls, device: str, description: str) -> _Port:
        port = super().__new__(cls, device)
        port.description = description
        return port

    @property
    def device(self) -> str:
        return str(self)


def test_no_serial_port_is_no_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    from serial.tools import list_ports

    monkeypatch.setattr(list_ports, "comports", list)
    assert by_subject(monkeypatch, "serial ports").state == "note"


@pytest.mark.parametrize("state", STATES)
def test_only_what_is_missing_fails_the_command(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], state: str
) -> None:
    from explore3d.cli.main import main

    monkeypatch.setattr(doctor, "examine", lambda: [doctor.Check("a", state, "b", "c", "d")])
    monkeypatch.setattr(sys, "argv", ["explore3d", "doctor", "--json"])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == (1 if state == "missing" else 0)
    assert json.loads(capsys.readouterr().out)[0]["needed_for"] == "c"


def test_it_asks_the_controller_on_a_port_and_moves_nothing(tmp_path: Path) -> None:
    tile = Path(__file__).resolve().parents[3] / "assets" / "meshes" / "tile.ply"
    (stage,) = Emulation(mesh=tile, tip_radius=5e-3, origin=(-0.15, -0.15, -0.06)).devices()
    with PtyServer([stage]) as server:
        port = server.ports[0]
        checks = {check.subject: check for check in doctor.controller(port, 115200)}
    assert checks[port].found.startswith("Grbl 1.1h.20190825, idle")
    assert checks["travel"].found == "[-300.0, -300.0, -100.0] to [0.0, 0.0, 0.0] mm"
    assert stage.motion.travelled == 0.0  # type: ignore[union-attr]
    (gone,) = doctor.controller(str(tmp_path / "no port"), 115200)
    assert gone.state == "missing" and "cannot open" in gone.found


def test_all_is_compiled_once_for_an_installation(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    package = tmp_path / "site-packages" / "mapping" / "__init__.py"
    package.parent.mkdir(parents=True)
    package.write_text("")
    compiled: list[object] = []  # what compiles them is carried out by every `make setup`
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setattr(doctor.mapping, "__file__", str(package))
    monkeypatch.setattr(explore3d.jobs, "run", lambda scene, out, progress: compiled.append(scene))
    monkeypatch.setattr(explore3d.jobs.batch, "rehearse", lambda quick: compiled.append(quick))
    monkeypatch.setattr(explore3d.bench.display, "bench_stepping", lambda rates, seconds: iter(rates))
    assert doctor.must_compile()
    doctor.compile_kernels(quiet=True)
    assert len(compiled) == 2 and not doctor.must_compile()
    os.utime(package, (1.0, 1.0))  # installed anew: its kernels do not count any more
    assert doctor.must_compile()
    (package.parents[1] / "pyproject.toml").write_text("")
    assert not doctor.must_compile()  # a checkout, which make setup compiles
