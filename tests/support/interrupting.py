"""Jobs that are ended at some moment, and folders that must not have changed by it."""

from __future__ import annotations

import hashlib
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from scene_files import write_scene_file

ROOT = Path(__file__).resolve().parents[2]
ASSETS = ROOT / "assets"
# s: a job of ten CPU seconds may be given a twentieth of a core; only what hangs takes longer
STUCK_AFTER = 900.0
SCENE = """
schema = "explore3d/scene/1"
title = "A bare tile"
seed = {seed}
[tip]
radius = "5 mm"
[model]
mesh = "{assets}/meshes/tile.ply"
[finger]
object = "{assets}/meshes/tile.ply"
rate = "200 Hz"
[finger.noise]
white = "0.05 mm"
correlated = "0.005 mm"
[survey]
smallest_feature = "0.4 mm"
speed = "30 mm/s"
[explore]
time_budget = "{budget}"
"""


def bare_tile(folder: Path, budget: str = "10 min", seed: int = 4) -> Path:
    """A scene that takes seconds, of a tile with nothing on it."""
    text = SCENE.format(assets=ASSETS, budget=budget, seed=seed)
    return write_scene_file(folder / f"tile-{budget.replace(' ', '-')}-{seed}.toml", text)


@dataclass(frozen=True)
class Ended:
    """How a program ended: its exit status (negative: by that signal), and what it said."""

    status: int
    out: str
    err: str

    @property
    def last(self) -> str:
        """The last line on stderr."""
        return (self.err.splitlines() or [""])[-1]


def explore3d(*words: object, after: float | None = None, how: str = "SIGINT", when: Path | None = None) -> Ended:
    """Run the program as a user does; send it a signal `after` so many seconds, counted once the file `when` is there.

    Signals come as a terminal sends them: Ctrl-C is not ignored.
    """
    command = [sys.executable, "-m", "explore3d", *map(str, words)]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1", "OPENBLAS_NUM_THREADS": "1"}
    environment["PYTHONFAULTHANDLER"] = "1"  # a crash says where
    process = subprocess.Popen(
        [sys.executable, "-c", HONEST, *command],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=environment,
        text=True,
    )
    if after is not None:
        patience = time.monotonic() + STUCK_AFTER
        while when is not None and not when.exists() and process.poll() is None and time.monotonic() < patience:
            time.sleep(0.002)
        time.sleep(after)
        if process.poll() is None:
            process.send_signal(getattr(signal, how))
    out, err = process.communicate(timeout=STUCK_AFTER)
    return Ended(process.returncode, out, err)


# A background program of a shell ignores Ctrl-C, and what it starts inherits that
HONEST = "import os, signal, sys; signal.signal(signal.SIGINT, signal.SIG_DFL); os.execv(sys.argv[1], sys.argv[1:])"


def digests(folder: Path) -> dict[str, str]:
    """The older session: every file but those of unfinished ones and half-written ones, with its SHA-256."""
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not path.relative_to(folder).parts[0].startswith(("unfinished-", ".part-"))
    }
