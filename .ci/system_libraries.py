"""System libraries that Open3D loads and that a bare Linux lacks.

They are installed where that is allowed, else unpacked into the environment, from where
mapping/geometry/mesh/open3d_import.py loads them, else it is said what to ask an administrator for.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import debian

# library: its package on Debian and Ubuntu
PACKAGES = {
    "libEGL.so.1": "libegl1",
    "libGL.so.1": "libgl1",
    "libX11.so.6": "libx11-6",
    "libusb-1.0.so.0": "libusb-1.0-0",
    "libudev.so.1": "libudev1",
    "libidn2.so.0": "libidn2-0",
}
# what those need in their turn; a package manager brings it of itself
BEHIND = {
    "libGLdispatch.so.0": "libglvnd0",
    "libGLX.so.0": "libglx0",
    "libxcb.so.1": "libxcb1",
    "libXau.so.6": "libxau6",
    "libXdmcp.so.6": "libxdmcp6",
    "libbsd.so.0": "libbsd0",
    "libmd.so.0": "libmd0",
}
ELSEWHERE = {
    "dnf": "dnf install libglvnd-egl libglvnd-glx libX11 libusb1 systemd-libs libidn2",
    "zypper": "zypper install Mesa-libEGL1 Mesa-libGL1 libX11-6 libusb-1_0-0 libudev1 libidn2-0",
    "pacman": "pacman -S libglvnd libx11 libusb systemd-libs libidn2",
}


def provide(python: Path, folder: Path) -> None:
    """Make open3d importable by that Python; `folder` takes what must be unpacked."""
    if sys.platform != "linux" or open3d_loads(python):
        return
    packages = missing(python, PACKAGES)
    if packages:
        print(f"setup: Open3D needs {', '.join(packages)}; installing them", flush=True)
        if debian.install(packages) and open3d_loads(python):
            return
        print(f"setup: not allowed to install them; unpacking them into {folder}", flush=True)
        unpack(packages + missing(python, BEHIND), folder)
        if open3d_loads(python):
            return
    sys.exit(f"setup: {remedy(packages)}\n{reason(python)}")


def missing(python: Path, packages: dict[str, str]) -> list[str]:
    """The packages of those libraries that the dynamic linker does not find."""
    test = "import ctypes, sys; ctypes.CDLL(sys.argv[1])"

    def found(library: str) -> bool:
        return subprocess.run([python, "-c", test, library], capture_output=True).returncode == 0

    return [package for library, package in packages.items() if not found(library)]


def unpack(packages: list[str], folder: Path) -> None:
    """Copy the shared libraries of those packages into the folder, under the names that programs ask for."""
    files = debian.unpack(packages)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for library in [*files.glob("usr/lib/*/lib*.so.*"), *files.glob("lib/*/lib*.so.*")]:
        if library.is_symlink():
            shutil.copyfile(library, folder / library.name)


def open3d_loads(python: Path) -> bool:
    """True if the environment can import open3d."""
    return not reason(python)


def reason(python: Path) -> str:
    """Why open3d cannot be imported, "" if it can."""
    test = "from mapping.geometry.mesh import open3d; open3d()"
    result = subprocess.run([python, "-c", test], capture_output=True, text=True)
    return result.stderr.strip().splitlines()[-1] if result.returncode else ""


def remedy(packages: list[str]) -> str:
    """What an administrator has to type."""
    if not packages:
        return "Open3D cannot be imported, though every system library that it is known to need is there:"
    known = [command for tool, command in ELSEWHERE.items() if shutil.which(tool)]
    command = known[0] if known else f"apt-get install --no-install-recommends {' '.join(packages)}"
    return f"Open3D needs system libraries that this machine lacks. Ask an administrator to run:\n    {command}"
