"""explore3d doctor: what of the installation works, what is missing, and what it is needed for."""

from __future__ import annotations

import contextlib
import os
import platform
import sys
import tempfile
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Annotated

import typer

import explore3d
import hw
import mapping
import planners
from explore3d.cli.options import Json
from explore3d.scene import example
from hw import FingerError
from mapping.geometry.mesh import open3d

# This example finds its base, follows a ridge and measures it: all kernels but those of inertia, of walls and of tables
COMPILES = "unknown_plate"
STATES = ("ok", "missing", "note")


@dataclass(frozen=True)
class Check:
    """One finding.

    Args:
        subject: what was looked at.
        state: "ok"; "missing", which something needs; "note", which only some uses need.
        found: what there is.
        needed_for: what it serves.
        remedy: what to do, "" if nothing.
    """

    subject: str
    state: str
    found: str
    needed_for: str
    remedy: str = ""


# package: module that must load, what it serves
REQUIRED_PACKAGES = {
    "numpy": ("numpy", "everything"),
    "scipy": ("scipy.optimize", "fits and statistics"),
    "numba": ("numba", "contact of the simulated finger, envelopes"),
    "libigl": ("igl", "curvature of meshes"),
    "emcee": ("emcee", "posterior distributions of a feature's size and place"),
    "trimesh": ("trimesh", "reading meshes"),
    "matplotlib": ("matplotlib", "the pictures of plans and of benches"),
    "pyarrow": ("pyarrow.parquet", "the table of features, stores of many logs"),
    "mcap": ("mcap.writer", "logs"),
    "zstandard": ("zstandard", "compressed logs"),
    "pydantic": ("pydantic", "scenes"),
    "pyserial": ("serial", "fingers on a serial port"),
}
OPTIONAL_PACKAGES = {
    "viser": ("viser", "watching in the browser: pip install explore3d[watch]"),
    "opencamlib": ("opencamlib", "comparison with its drop cutter: pip install explore3d[peers]"),
    "pymeshlab": ("pymeshlab", "comparison with its curvatures: pip install explore3d[peers]"),
    "arviz": ("arviz", "further diagnostics of the posteriors: pip install explore3d[arviz]"),
}


def examine() -> list[Check]:
    """Every check, in the order in which one would mend things."""
    checks = [_python()]
    checks += [_package(name, *what, absent="missing") for name, what in REQUIRED_PACKAGES.items()]
    checks += [_open3d(), _cache()]
    checks += [_package(name, *what, absent="note") for name, what in OPTIONAL_PACKAGES.items()]
    return checks + _serial_ports()


def _python() -> Check:
    found = f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    good = sys.version_info >= (3, 11)
    return Check(
        "Python", "ok" if good else "missing", found, "everything", "" if good else "install Python 3.11 or newer"
    )


def _package(name: str, module: str, needed_for: str, absent: str) -> Check:
    from importlib.metadata import PackageNotFoundError, version

    try:
        found = version(name)
    except PackageNotFoundError:
        return Check(name, absent, "not installed", needed_for, "make setup" if absent == "missing" else "")
    reason = _failure(lambda: import_module(module))
    if reason:
        return Check(
            name, absent, f"{found} does not load: {reason}", needed_for, f"pip install --force-reinstall {name}"
        )
    return Check(name, "ok", found, needed_for)


def _open3d() -> Check:
    needed_for = "meshes from scattered points"
    reason = _failure(open3d)
    if reason:
        return Check("open3d", "missing", reason, needed_for, "make setup installs or unpacks what it lacks")
    return Check("open3d", "ok", str(open3d().__version__), needed_for)


def _kernel_folder() -> str:
    """Compiled kernels are kept beside the sources, or where NUMBA_CACHE_DIR says."""
    return os.environ.get("NUMBA_CACHE_DIR") or os.path.dirname(mapping.__file__ or "")


def _cache() -> Check:
    folder = _kernel_folder()
    needed_for = "keeping compiled kernels, else each start compiles them anew"
    if os.access(folder, os.W_OK):
        return Check("kernel cache", "ok", folder, needed_for)
    return Check("kernel cache", "note", f"{folder} cannot be written", needed_for, "set NUMBA_CACHE_DIR")


def _serial_ports() -> list[Check]:
    needed_for = "fingers on a serial port; the simulated finger needs none"
    try:
        from serial.tools.list_ports import comports
    except ImportError:
        return []
    ports = sorted(comports())
    if not ports:
        return [Check("serial ports", "note", "none found", needed_for)]
    return [_serial_port(port.device, port.description or "", needed_for) for port in ports]


def _serial_port(device: str, description: str, needed_for: str) -> Check:
    if os.name == "posix" and not os.access(device, os.R_OK | os.W_OK):
        remedy = "join the group that owns it (usually: sudo usermod -aG dialout $USER) and log in again"
        return Check(device, "note", f"{description}; no permission", needed_for, remedy)
    return Check(device, "ok", description, needed_for)


def _failure(load: Callable[[], object]) -> str:
    """Why a module does not load, "" if it does; its own code may raise whatever it likes."""
    try:
        load()
    except Exception as error:
        return f"{type(error).__name__}: {' '.join(str(error).split())}"
    return ""


def compile_kernels(quiet: bool) -> None:
    """Explore an example, analyse tables in folders of their own and display a body; what was compiled stays in numba's
    cache.

    So does Python's own bytecode, which an editable installation does not have and some environments do not write: 0.3
    of the 1.7 CPU s of a quick analysis went into compiling 350 files anew.
    """
    from compileall import compile_dir

    from explore3d.bench.display import bench_stepping
    from explore3d.cli.progress import shown
    from explore3d.jobs import run
    from explore3d.jobs.batch import rehearse
    from hw.sensors import load_sample_kernels
    from mapping.assembly import load_faint_kernel

    with tempfile.TemporaryDirectory(prefix="explore3d-") as folder, shown(quiet) as progress:
        run(example(COMPILES).scene, Path(folder) / "out", progress=progress)
    load_sample_kernels()
    load_faint_kernel()
    rehearse(quick=False)
    next(bench_stepping([1000.0], 0.01))  # over a body that has details of every kind
    for package in (explore3d, planners, hw, mapping):
        compile_dir(package.__path__[0], quiet=2)
    with contextlib.suppress(OSError):  # where it cannot be written nothing was kept, either
        stamp = _compiled_stamp()
        stamp.parent.mkdir(exist_ok=True)
        stamp.write_text(_compiled_for())


def must_compile() -> bool:
    """True if kernels of this installation can be kept, and were not compiled yet.

    Those of a checkout are its `make setup`'s business, and of whoever changes them.
    """
    if (Path(mapping.__file__ or "").parents[1] / "pyproject.toml").is_file() or not os.access(
        _kernel_folder(), os.W_OK
    ):
        return False
    try:
        return _compiled_stamp().read_text() != _compiled_for()
    except OSError:
        return True


def _compiled_stamp() -> Path:
    return Path(_kernel_folder()) / "__pycache__" / "explore3d-compiled"


def _compiled_for() -> str:
    """What makes numba compile anew: another installation, Python, or numba."""
    from importlib.metadata import version

    return f"{sys.version} {version('numba')} {os.stat(mapping.__file__ or '').st_mtime_ns}"


def controller(port: str, baudrate: int) -> list[Check]:
    """What stands on a port: opened, asked, and let go of; nothing moves, DTR and RTS are left alone."""
    from hw.grbl import GrblController

    needed_for = "a finger of kind grbl"
    machine = GrblController(port, baudrate=baudrate)
    try:
        machine.open()
    except FingerError as error:
        return [Check(port, "missing", " ".join(str(error).split()), needed_for)]
    with closing(machine):
        settings = machine.settings
        low, high = 1e3 * settings.bounds
        place = machine.alarm or "idle"
        told = [
            Check(port, "ok", f"{machine.firmware}, {place}, {1e3 * machine.round_trip:.0f} ms to ask", needed_for),
            Check("travel", "ok", f"{low.round(3).tolist()} to {high.round(3).tolist()} mm", "the limits of all moves"),
            Check("speed", "ok", f"{(1e3 * settings.max_rate).round(1).tolist()} mm/s", "the limits of all moves"),
            Check("resolution", "ok", f"{1e6 * settings.resolution:.1f} µm", "what can be seen at all"),
        ]
        return told + [Check("doubt", "note", doubt, needed_for) for doubt in machine.doubts]


def doctor(
    compile: Annotated[
        bool,
        typer.Option("--compile", help="Compile all kernels now (a minute or two), so that the first run is quick."),
    ] = False,
    json: Json = False,
    port: Annotated[
        str | None, typer.Option(help="Ask the controller on this serial port, too; nothing is moved.")
    ] = None,
    baudrate: Annotated[int, typer.Option(help="Of that port.", min=1)] = 115200,
) -> None:
    """Check the installation and the serial ports; say what is missing and what it is needed for.

    The exit status is 1 if something is missing that the program cannot do without.

    Example: explore3d doctor --port /dev/ttyUSB0
    """
    from dataclasses import asdict
    from json import dumps

    def line(check: Check) -> str:
        remedy = f" -> {check.remedy}" if check.remedy else ""
        return f"{check.state:<8}{check.subject:<{wide}}  {check.found} ({check.needed_for}){remedy}"

    if compile:
        compile_kernels(quiet=json)
    checks = examine() + ([] if port is None else controller(port, baudrate))
    wide = max(len(check.subject) for check in checks)
    print(dumps([asdict(check) for check in checks]) if json else "\n".join(line(check) for check in checks))
    if any(check.state == "missing" for check in checks):
        raise typer.Exit(1)
