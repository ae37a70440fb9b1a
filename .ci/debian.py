"""Packages of Debian and its kin: installed where we may, else unpacked into a folder without any rights."""

from __future__ import annotations

import atexit
import os
import shutil
import subprocess
import tempfile
from pathlib import Path


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
    """A temporary folder with the files of those packages alone, without what they depend on.

    A package that cannot be fetched is left out; the folder is empty if this is no such system. apt gets a
    state and a cache of its own, so that it needs no rights and leaves the system's untouched.
    """
    folder = Path(tempfile.mkdtemp(prefix="explore3d-setup-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    for name in ("files", "state/lists/partial", "cache/archives/partial"):
        (folder / name).mkdir(parents=True)
    if not (shutil.which("apt-get") and shutil.which("dpkg-deb")):
        return folder / "files"
    settings = {
        "Dir::State": folder / "state",
        "Dir::Cache": folder / "cache",
        "Debug::NoLocking": "1",
        "APT::Sandbox::User": "",
    }
    command = ["apt-get", "-qq", *(f"-o{key}={value}" for key, value in settings.items())]
    _run([*command, "update"])
    for package in packages:
        _run([*command, "download", package], folder)
    for archive in sorted(folder.glob("*.deb")):
        _run(["dpkg-deb", "-x", str(archive), str(folder / "files")])
    return folder / "files"


def _run(command: list[str], folder: Path | None = None) -> bool:
    try:
        return subprocess.run(command, cwd=folder, stdout=subprocess.DEVNULL, stdin=subprocess.DEVNULL).returncode == 0
    except OSError:
        return False
