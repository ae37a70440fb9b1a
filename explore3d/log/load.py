"""load_logs: whatever was recorded, logs of ours and tables in any mixture, as one Log."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from explore3d import UnitError, UserError, parse_length
from explore3d.log.own import Log, merge
from explore3d.log.readers import read_recording
from explore3d.scene import read_tolerances
from mapping.base import Form


def load_logs(
    paths: Sequence[Path | str],
    *,
    tip_radius: str | float | None = None,
    tip_sd: str | float | None = None,
    form: str | None = None,
    mask: Sequence[str] | None = None,
    in_contact: bool | None = None,
    tolerances: Path | str | None = None,
    **table: Any,
) -> Log:
    """Read and merge recordings of one object with one fingertip.

    Args:
        paths: MCAP logs, folders of sessions (their log is taken), tables in text, NPY, NPZ, PLY, PCD, OBJ, packed
            or not; each is known by what it holds.
        tip_radius: for tables, which do not state it, and for a log whose beginning is destroyed: "2 um", or a
            number in m. It must agree with what a log states.
        tip_sd: standard deviation of that radius; None: what scene or table say.
        form: what the base is, where it is fitted (mapping.base.Form); None: what a table's sidecar says.
        mask: stretches in x that the base is not fitted to, "1.2mm..1.4mm"; None: what a table's sidecar says.
        in_contact: True if the finger touched at every sample, and nothing is to be left out as lifted; None: so it is
            of logs of ours, and of a table what its sidecar says.
        tolerances: file that says what the drawing allows (explore3d.scene.read_tolerances); None: what scenes and
            sidecars say.
        table: the other settings of read_table; `average` is one for every kind of file.

    Raises:
        UserError: one line naming the file and the field.
    """
    allowed = None if tolerances is None else read_tolerances(tolerances)
    log = merge([read_recording(Path(path), {"tip_radius": tip_radius} | table) for path in paths])
    if tip_sd is not None:
        log = replace(log, tip_sd=_tip_sd(tip_sd), tip_sd_assumed=False)
    if in_contact is not None:
        log = replace(log, in_contact=in_contact)
    if allowed is not None:
        log = replace(log, tolerances=allowed)
    if form is None and mask is None:
        return log
    masks = log.form.masks if mask is None else Form.read("auto", mask).masks
    return replace(log, form=replace(log.form if form is None else Form.read(form), masks=masks))


def _tip_sd(value: str | float) -> float:
    try:
        sd = parse_length(value)
    except UnitError as error:
        raise UserError(f"tip_sd: {error}") from error
    if not 0.0 <= sd < float("inf"):
        raise UserError(f'tip_sd must be a length that is not negative, say "20 nm"; found {value!r}')
    return sd
