"""Quantities with units become SI numbers, or an error that says what is possible."""

from __future__ import annotations

import math
import re

import pytest

from explore3d.errors import UnitError
from explore3d.scene.units import (
    UNITS,
    parse_angle,
    parse_force,
    parse_length,
    parse_quantity,
    parse_rate,
    parse_speed,
    parse_time,
    unit_factor,
)


@pytest.mark.parametrize(
    ("text", "metres"),
    [
        ("0.65 mm", 0.65e-3),
        ("2 um", 2e-6),
        ("2µm", 2e-6),
        ("2 \u03bcm", 2e-6),
        ("1e-3 km", 1.0),
        ("-.5 cm", -0.005),
        ("  3nm ", 3e-9),
        ("+1. in", 0.0254),
        (0.25, 0.25),
        (3, 3.0),
    ],
)
def test_a_length_becomes_metres(text: object, metres: float) -> None:
    assert parse_length(text) == pytest.approx(metres, rel=1e-15)


def test_each_dimension_has_its_own_units() -> None:
    assert parse_angle("180 deg") == pytest.approx(math.pi)
    assert parse_rate("5 kHz") == 5000.0
    assert parse_speed("30 mm/s") == pytest.approx(0.03)
    assert parse_speed("60 mm/min") == pytest.approx(1e-3)
    assert parse_force("250 mN") == pytest.approx(0.25)
    assert parse_time("10 min") == 600.0


@pytest.mark.parametrize("dimension", UNITS)
def test_the_first_unit_of_each_dimension_is_the_si_unit(dimension: str) -> None:
    unit = next(iter(UNITS[dimension]))
    assert parse_quantity(f"1.25 {unit}", dimension) == 1.25


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("0.65", "unit missing in '0.65'; write for example \"0.65 mm\""),
        ("1 mn", "unknown unit of length 'mn'; did you mean 'mm' or 'nm' or 'in'? possible: m, km, cm, mm"),
        ("1 mmm", "unknown unit of length 'mmm'; did you mean 'mm'? possible: m, km, cm, mm"),
        ("1 furlong", "unknown unit of length 'furlong'; possible: m, km"),
        ("1 N", "'N' is a unit of force, not of length; possible: m, km"),
        ("wide", "expected a length like \"1 mm\" or a number in m; found 'wide'"),
        ("", "expected a length"),
        ("1e999 m", "expected a finite length; found '1e999 m'"),
        (math.nan, "expected a finite length; found nan"),
        (math.inf, "expected a finite length; found inf"),
        (True, "found True"),
        (None, "found None"),
        ([1.0], "found [1.0]"),
    ],
)
def test_what_is_no_length_is_refused_with_the_possibilities(value: object, message: str) -> None:
    with pytest.raises(UnitError, match=re.escape(message)):
        parse_length(value)


def test_a_bare_unit_has_a_factor() -> None:
    assert unit_factor("mm") == 1e-3
    with pytest.raises(UnitError, match="unknown unit of length 'MM'"):
        unit_factor("MM")
