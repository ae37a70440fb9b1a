"""The one place that imports open3d: it finds the system libraries that a bare machine lacks."""

from __future__ import annotations

import ctypes
import sys
from functools import cache
from pathlib import Path
from typing import Any

from mapping import Open3DError


@cache
def open3d() -> Any:
    """The open3d module, its system libraries loaded beforehand where they were unpacked into the environment.

    Raises:
        Open3DError: open3d is not installed, or a system library is missing; names it and the remedy.
    """
    unloaded = preload(Path(sys.prefix) / "lib" / "explore3d-syslibs")
    try:
        import open3d as module
    except ImportError as error:
        tried = "".join(f"; {name} was unpacked but does not load: {why}" for name, why in unloaded.items())
        raise Open3DError(
            f"open3d cannot be imported, because {error}{tried}. "
            "Run `explore3d doctor` to see what is missing, or `make setup` to unpack it without root rights."
        ) from error
    return module


def preload(folder: Path) -> dict[str, str]:
    """Load every shared library of a folder for all later imports; what failed, with the reason.

    Libraries need one another in an unknown order, so the folder is passed over until nothing more loads.
    """
    waiting = sorted(folder.glob("*.so*")) if folder.is_dir() else []
    failed: dict[str, str] = {}
    progress = True
    while waiting and progress:
        failed = {}
        for library in waiting:
            try:
                ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)
            except OSError as error:
                failed[library.name] = str(error)
        progress = len(failed) < len(waiting)
        waiting = [library for library in waiting if library.name in failed]
    return failed
