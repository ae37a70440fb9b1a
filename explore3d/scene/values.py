"""Values of a scene file: quantities with units, and the base of all its tables."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field
from pydantic.fields import FieldInfo

from explore3d import (
    UnitError,
    parse_angle,
    parse_force,
    parse_length,
    parse_rate,
    parse_speed,
    parse_time,
    unit_factor,
)


def _sweep_speed(value: object) -> float | Literal["fastest"]:
    """A speed in m/s, or the word that leaves it to the pace."""
    if value == "fastest":
        return "fastest"
    try:
        speed = parse_speed(value)
    except UnitError as error:
        raise UnitError(f'{error}; or write "fastest"') from error
    if speed <= 0:
        raise UnitError(f'should be greater than 0, or "fastest"; found {value!r}')
    return speed


Signed = Annotated[float, BeforeValidator(parse_length)]
Length = Annotated[float, BeforeValidator(parse_length), Field(gt=0)]
Extent = Annotated[float, BeforeValidator(parse_length), Field(ge=0)]
Angle = Annotated[float, BeforeValidator(parse_angle), Field(ge=0)]
Turn = Annotated[float, BeforeValidator(parse_angle)]
Rate = Annotated[float, BeforeValidator(parse_rate), Field(gt=0)]
Speed = Annotated[float, BeforeValidator(parse_speed), Field(gt=0)]
SweepSpeed = Annotated[float | Literal["fastest"], BeforeValidator(_sweep_speed)]
Force = Annotated[float, BeforeValidator(parse_force), Field(gt=0)]
Time = Annotated[float, BeforeValidator(parse_time), Field(gt=0)]
Delay = Annotated[float, BeforeValidator(parse_time)]
Point = tuple[Signed, Signed, Signed]


def _known_unit(unit: str) -> str:
    unit_factor(unit)
    return unit


LengthUnit = Annotated[str, AfterValidator(_known_unit)]


# Of a key that tells people something and that no job reads; every other key must change something
INFORMATIVE = Field(json_schema_extra={"informative": True})


def is_informative(key: FieldInfo) -> bool:
    """True if no job reads the key."""
    extra = key.json_schema_extra
    return isinstance(extra, dict) and bool(extra.get("informative"))


class Table(BaseModel):
    """A table of the scene file: immutable, and no key that is not known."""

    model_config = ConfigDict(extra="forbid", frozen=True)
