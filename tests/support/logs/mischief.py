"""Logs that kill, hang, or eat the process that reads them: a reader of another package, offered as an entry point."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

MARK = b"MISCHIEF "


class MischiefReader:
    """Reads files that begin with MARK and a word that says what to do."""

    name = "mischief"
    unsaid = ()

    def sniff(self, first: bytes) -> float:
        return 1.0 if first.startswith(MARK) else 0.0

    def read(self, path: Path, settings: Mapping[str, Any]) -> Any:
        word = path.read_bytes()[len(MARK) :].split()[0].decode()
        if word == "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        if word == "segfault":
            os.kill(os.getpid(), signal.SIGSEGV)
        if word == "sleep":
            time.sleep(600.0)
        if word == "eat":
            held = [np.empty(1 << 24) for _ in range(1000)]
            raise AssertionError(f"{len(held)} blocks of 128 MB were given")
        raise ZeroDivisionError(f"a fault of the reader: {word}")


def installed(folder: Path) -> Path:
    """A folder for PYTHONPATH in which the reader is installed as a package of its own."""
    about = folder / "mischief-1.0.dist-info"
    about.mkdir(parents=True, exist_ok=True)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: mischief\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[explore3d.readers]\nmischief = mischief:MischiefReader\n")
    (folder / "mischief.py").write_text(Path(__file__).read_text())
    return folder
