"""Set up the virtual environment .venv: python3 .ci/setup.py [EXTRA ...], for example "dev".

Needs nothing but Python's standard library: neither ensurepip nor pip, neither root nor a compiler. It may be
run again at any time; what is there already is kept.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import debian
import system_libraries

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
PYTHON = VENV / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
OLDEST = (3, 11)


def main(extras: list[str]) -> None:
    """Make the environment, install the project with its extras, provide the system libraries."""
    if sys.version_info < OLDEST:
        found = ".".join(map(str, sys.version_info[:2]))
        sys.exit(f"setup: Python 3.11 or newer is needed, found {found}; try: make PYTHON=python3.12 ...")
    make_environment()
    project = f".[{','.join(extras)}]" if extras else "."
    print(f"setup: installing {project} and what it depends on (some 1 GB; minutes the first time)", flush=True)
    quiet = {**os.environ, "PYTHONWARNINGS": "ignore", "PIP_DISABLE_PIP_VERSION_CHECK": "1"}
    # By a path alone: the usual hook is asked last, so that the checkout's own folder, which has the package's name,
    # would stand for the package wherever Python is begun beside it
    by_path = ["--config-settings", "editable_mode=compat"]
    subprocess.run([*pip(), "install", "--quiet", *by_path, "--editable", project], cwd=ROOT, env=quiet, check=True)
    system_libraries.provide(PYTHON, VENV / "lib" / "explore3d-syslibs")
    print("setup: compiling, so that the first run is as quick as the second (a minute or two)", flush=True)
    compiling = [str(PYTHON), "-m", "explore3d", "doctor", "--compile", "--json"]
    subprocess.run(compiling, cwd=ROOT, env=quiet, stdout=subprocess.DEVNULL, check=True)


def make_environment() -> None:
    """The virtual environment, without pip where the system's Python came without ensurepip."""
    if works([str(PYTHON), "-c", ""]):
        return
    print(f"setup: making {VENV}", flush=True)
    make = [sys.executable, "-m", "venv", "--clear"]
    if not works([*make, str(VENV)]):
        subprocess.run([*make, "--without-pip", str(VENV)], check=True)


def pip() -> list[str]:
    """How to call a pip that installs into the environment."""
    inside = [str(PYTHON), "-m", "pip"]
    outside = [sys.executable, "-m", "pip", "--python", str(PYTHON)]
    for command in (inside, outside):
        if works([*command, "--version"]):
            return command
    wheel = next(iter(debian.unpack(["python3-pip-whl"]).glob("usr/share/python-wheels/pip-*.whl")), None)
    if wheel is None:
        sys.exit(
            "setup: this Python has neither pip nor ensurepip. Ask an administrator for one of them:\n"
            "    Debian, Ubuntu: apt-get install python3-venv\n    Fedora: dnf install python3-pip\n"
            "    Arch: pacman -S python-pip\n    Alpine: apk add py3-pip"
        )
    subprocess.run([str(PYTHON), f"{wheel}/pip", "install", "--quiet", "pip"], check=True)
    return inside


def works(command: list[str]) -> bool:
    """True if the command can be run and ends well."""
    try:
        return subprocess.run(command, capture_output=True, check=False).returncode == 0
    except OSError:
        return False


if __name__ == "__main__":
    main(sys.argv[1:])
