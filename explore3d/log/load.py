"""load_logs: whatever was recorded, logs of ours and tables in any mixture, as one Log."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from explore3d import UserError, parse_length
from explore3d.log.format import LOG
from explore3d.log.reader import is_log, read_log
from explore3d.log.record import Log, merge


def load_logs(paths: Sequence[Path | str], *, tip_radius: str | float | None = None, **table: Any) -> Log:
    """Read and merge recordings of one object with one fingertip.

    Args:
        paths: MCAP logs, folders of sessions (their log is taken), CSV or TXT tables.
        tip_radius: for tables, which do not state it, and for a log whose beginning is destroyed: "2 um", or a
            number in m. It must agree with what a log states.
        table: the other settings of read_table.

    Raises:
        UserError: one line naming the file and the field.
    """
    return merge([_load(Path(path), tip_radius, table) for path in paths])


def _load(path: Path, tip_radius: str | float | None, table: dict[str, Any]) -> Log:
    from explore3d.log.table import read_table

    if path.is_dir():
        if not (path / LOG).is_file():
            raise UserError(f"{path}: is a folder without {LOG}; expected a log, a table, or the folder of a session")
        path = path / LOG
    if path.suffix == ".mcap" or is_log(path):
        return read_log(path, None if tip_radius is None else parse_length(tip_radius))
    return read_table(path, tip_radius=tip_radius, **table)
