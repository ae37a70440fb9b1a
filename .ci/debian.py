"""Packages of Debian and its kin: installed where we may, else unpacked into a folder without any rights."""

from __future__ import annotations

import atexit
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

STATUS = Path("/var/lib/dpkg/status")


def install(packages: list[str]) -> bool:
    """Install with apt-get as root or by passwordless sudo; False if that is not possible here."""
    if not shutil.which("apt-get"):
        return False
    rights = [] if os.geteuid() == 0 else ["sudo", "-n"]
    if rights and not _run([*rights, "true"]):
        return False
    command = [*rights, "env", "DEBIAN_FRONTEND=noninteractive", "apt-get", "-qq", "-y"]
    wanted = [*command, "install", "--no-install-recommends", *packages]
    return _run(wanted) or (_run([*command, "update"]) and _run(wanted))


def unpack(packages: list[str]) -> Path:
    """A temporary folder with the files of those packages, and of what they need that is not installed.

    The folder is empty if this is no such system or the packages cannot be fetched. apt gets a state and a
    cache of its own, so that it needs no rights and leaves the system's untouched.
    """
    folder = Path(tempfile.mkdtemp(prefix="explore3d-setup-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    files, private = folder / "files", folder / "apt"
    files.mkdir()
    if not (shutil.which("apt-get") and shutil.which("dpkg-deb") and STATUS.is_file()):
        return files
    for name in ("state/lists/partial", "cache/archives/partial"):
        (private / name).mkdir(parents=True)
    settings = {
        "Dir::State": private / "state",
        "Dir::State::status": STATUS,
        "Dir::Cache": private / "cache",
        "Debug::NoLocking": "1",
        "APT::Sandbox::User": "",
    }
    command = ["apt-get", "-qq", "-y", *(f"-o{key}={value}" for key, value in settings.items())]
    fetch = ["install", "--download-only", "--reinstall", "--no-install-recommends", *packages]
    if _run([*command, "update"]) and _run([*command, *fetch]):
        for package in sorted((private / "cache" / "archives").glob("*.deb")):
            _run(["dpkg-deb", "-x", str(package), str(files)])
    return files


def _run(command: list[str]) -> bool:
    try:
        return subprocess.run(command, stdout=subprocess.DEVNULL, stdin=subprocess.DEVNULL, check=False).returncode == 0
    except OSError:
        return False
