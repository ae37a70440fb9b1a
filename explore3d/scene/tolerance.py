"""Tolerances: what a drawing allows, as a scene, a table's sidecar or a file of their own says it."""

from __future__ import annotations

import tomllib
from math import inf
from pathlib import Path
from typing import Any, Literal

from pydantic import ConfigDict, ValidationError, model_validator

from explore3d import UserError
from explore3d.scene.complaint import complaint
from explore3d.scene.values import Extent, Length, Table
from mapping import KINDS
from mapping.inference.kinds import kind_named
from mapping.model import Tolerance


class ToleranceTable(Table):
    """What a drawing allows of a size of every feature of a kind, hollows measured downwards: at most `limit` (m)."""

    kind: Literal["any", *KINDS]  # type: ignore[valid-type]
    size: Literal["height", "width", "length"]
    limit: Length | None = None
    least: Extent = 0.0

    @model_validator(mode="after")
    def _says_something(self) -> ToleranceTable:
        if self.limit is None and self.least == 0.0:
            raise ValueError("give limit (at most), least (at least), or both")
        if self.limit is not None and self.least >= self.limit:
            raise ValueError(f"least must lie below limit; found least {self.least:g} m and limit {self.limit:g} m")
        if self.size == "length" and self.kind != "any" and not kind_named(self.kind).line:
            lines = ", ".join(name for name in KINDS if kind_named(name).line)
            raise ValueError(f"a {self.kind} has no length; possible with length: any, {lines}")
        return self

    def tolerance(self) -> Tolerance:
        """The same without the words of a file."""
        return Tolerance(self.kind, self.size, inf if self.limit is None else self.limit, self.least)


class _Drawing(Table):
    """A file that holds tolerances alone."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    tolerance: tuple[ToleranceTable, ...]


def read_tolerances(path: Path | str) -> tuple[Tolerance, ...]:
    """The [[tolerance]] tables of a TOML file: of one that holds nothing else, or of a scene.

    Raises:
        UserError: no such file, not TOML, or a table that says nothing possible; one line that names the field.
    """
    path = Path(path)
    try:
        tables: dict[str, Any] = tomllib.loads(path.read_text("utf-8-sig"))
    except OSError as error:
        raise UserError(f"{path}: cannot read tolerances from it: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UserError(f"{path}: is not TOML: {error}") from error
    if str(tables.get("schema", "")).startswith("explore3d/scene"):
        tables = {"tolerance": tables.get("tolerance", [])}
    if not tables.get("tolerance"):
        raise UserError(f"{path}: holds no [[tolerance]] table; docs/scene.md shows one")
    try:
        return tuple(each.tolerance() for each in _Drawing.model_validate(tables).tolerance)
    except ValidationError as error:
        raise UserError(f"{path}: {complaint(error, _Drawing)}") from error
