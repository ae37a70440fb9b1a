"""load_logs: whatever was recorded, logs of ours and tables in any mixture, as one Log."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from explore3d.log.readers import read_recording
from explore3d.log.record import Log, merge


def load_logs(paths: Sequence[Path | str], *, tip_radius: str | float | None = None, **table: Any) -> Log:
    """Read and merge recordings of one object with one fingertip.

    Args:
        paths: MCAP logs, folders of sessions (their log is taken), tables in text, NPY, NPZ, PLY, PCD, OBJ, packed
            or not; each is known by what it holds.
        tip_radius: for tables, which do not state it, and for a log whose beginning is destroyed: "2 um", or a
            number in m. It must agree with what a log states.
        table: the other settings of read_table.

    Raises:
        UserError: one line naming the file and the field.
    """
    return merge([read_recording(Path(path), {"tip_radius": tip_radius} | table) for path in paths])
