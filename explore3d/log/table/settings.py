"""TableSettings: what a table of numbers does not say of itself; from options and from a sidecar next to it."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, ValidationError, model_validator

from explore3d import UserError
from explore3d.log.table.columns import Role
from explore3d.scene import Extent, Length, LengthUnit, Point, Table, ToleranceTable, complaint

Row = tuple[float, float, float]


def _split_columns(value: object) -> object:
    """{"x": "X", "z": "Y"} from "x=X, z=Y"; numbers count columns from 1."""
    if not isinstance(value, str):
        return value
    pairs = [pair.partition("=") for pair in value.split(",")]
    if not all(equals and role.strip() and column.strip() for role, equals, column in pairs):
        raise ValueError(f'expected "x=NAME, z=NAME" or "x=1, z=2"; found {value!r}')
    return {role.strip(): int(c) if (c := column.strip()).isdecimal() else c for role, _, column in pairs}


def _both_ways(value: object) -> object:
    """Two distances from one, or from "1 um, 2 um"."""
    if isinstance(value, str):
        value = [part.strip() for part in value.split(",")]
    if isinstance(value, list | tuple) and len(value) == 1:
        return (value[0], value[0])
    return (value, value) if isinstance(value, int | float) and not isinstance(value, bool) else value


def _proper(rotation: tuple[Row, Row, Row]) -> tuple[Row, Row, Row]:
    matrix = np.array(rotation)
    if not np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-6) or np.linalg.det(matrix) < 0:
        raise ValueError(f"must be a proper rotation (orthonormal rows, determinant 1); found {matrix.tolist()}")
    return rotation


class TableFrame(Table):
    """Pose of the table's frame in the object's: object = rotation @ table + origin."""

    origin: Point = (0.0, 0.0, 0.0)
    rotation: Annotated[tuple[Row, Row, Row], AfterValidator(_proper)] = ((1, 0, 0), (0, 1, 0), (0, 0, 1))


class TableSettings(Table):
    """How to read a table.

    Args:
        units: of the coordinates, one for all or by column role; None: the file's header states them.
        tip_radius: radius of the fingertip, m.
        columns: which column (by name, or by number from 1) plays which role; what is not given is found by name.
        frame: pose of the table's frame in the object's.
        jump: distance between consecutive samples beyond which a new sweep begins, m; None: ten median steps.
        reference: the point of the ball that the coordinates give, its "centre" or its "bottom" (centre - r z).
        tip_sd: standard deviation of that radius, m; None: not known, TIP_DOUBT of the radius is assumed.
        form: what the base of the table is, where it is fitted: "auto", "line", "arc", "poly:N",
            "gaussian:WAVELENGTH" or "none".
        mask: stretches in x that the base is not fitted to, "1.2mm..1.4mm".
        in_contact: True if the finger touched at every sample; else what is recognised as lifted is left out.
        decimal: sign of the numbers, where the file leaves it open ("1,234"); None: found.
        pixel: distance of the columns and of the rows of a map of heights, m; one for both or two.
        average: runs of so many consecutive samples become one each, their mean; None: every sample is taken.
        part: which one of several the file holds: topic of a bag, sheet of a workbook, channel of an instrument.
        tolerance: what the drawing allows, as in a scene.
    """

    units: LengthUnit | dict[Role, LengthUnit] | None = None
    tip_radius: Length | None = None
    columns: Annotated[dict[Role, str | int], BeforeValidator(_split_columns)] = Field(default_factory=dict)
    frame: TableFrame = TableFrame()
    jump: Length | None = None
    reference: Literal["centre", "bottom"] = "centre"
    tip_sd: Extent | None = None
    form: str = "auto"
    mask: tuple[str, ...] = ()
    in_contact: bool = False
    decimal: Literal[".", ","] | None = None
    pixel: Annotated[tuple[Length, Length] | None, BeforeValidator(_both_ways)] = None
    average: Annotated[int, Field(ge=1)] | None = None
    part: str | None = None
    tolerance: tuple[ToleranceTable, ...] = ()

    @model_validator(mode="before")
    @classmethod
    def _without_schema(cls, data: Any) -> Any:
        if isinstance(data, dict) and data.get("schema") == "explore3d/table/1":
            return {key: value for key, value in data.items() if key != "schema"}
        return data


def load_settings(table: Path, **options: Any) -> tuple[TableSettings, Path | None]:
    """The settings for a table, and its sidecar if it has one; options that are not None win.

    The sidecar of scan.csv is scan.csv.toml or scan.toml (unless that is a scene).

    Raises:
        UserError: a setting that is unknown or wrong, in one line that names the file and the field.
    """
    sidecar = sidecar_of(table)
    stated: dict[str, Any] = {}
    if sidecar is not None:
        stated = _parse(sidecar)
        _validate(stated, sidecar)
    given = {key: value for key, value in options.items() if value is not None}
    return _validate(stated | given, table), sidecar


def sidecar_of(table: Path) -> Path | None:
    """The file that says what a table does not: scan.csv.toml or scan.toml beside scan.csv, unless it is a scene.

    Raises:
        UserError: it is not TOML, or cannot be read.
    """
    return next((path for path in (Path(f"{table}.toml"), table.with_suffix(".toml")) if _is_sidecar(path)), None)


def _is_sidecar(path: Path) -> bool:
    if not path.is_file():
        return False
    return not str(_parse(path).get("schema", "")).startswith("explore3d/scene")


def _parse(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text("utf-8-sig"))
    except OSError as error:
        raise UserError(f"{path}: cannot read it: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UserError(f"{path}: is not TOML: {error}") from error


def _validate(data: dict[str, Any], path: Path) -> TableSettings:
    try:
        return TableSettings.model_validate(data)
    except ValidationError as error:
        raise UserError(f"{path}: {complaint(error, TableSettings)}") from error
