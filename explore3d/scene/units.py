"""Units: quantities as people write them ("0.65 mm", "5 kHz") become SI numbers and back, here and nowhere else.

Lengths become text in mapping/feature.py, durations and counts here.
"""

from __future__ import annotations

import math
import re
from difflib import get_close_matches

from explore3d import UnitError
from mapping import UNKNOWN_TEXT

UNITS: dict[str, dict[str, float]] = {
    "length": {
        "m": 1.0,
        "km": 1e3,
        "cm": 1e-2,
        "mm": 1e-3,
        "um": 1e-6,
        "µm": 1e-6,
        "μm": 1e-6,
        "nm": 1e-9,
        "in": 25.4e-3,
    },
    "angle": {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180.0, "°": math.pi / 180.0},
    "rate": {"Hz": 1.0, "kHz": 1e3, "MHz": 1e6},
    "speed": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "um/s": 1e-6, "mm/min": 1e-3 / 60.0, "m/min": 1.0 / 60.0},
    "force": {"N": 1.0, "kN": 1e3, "mN": 1e-3, "uN": 1e-6},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0, "h": 3600.0},
}
SI = {dimension: next(iter(units)) for dimension, units in UNITS.items()}

_QUANTITY = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S*)\s*")


def parse_quantity(value: object, dimension: str) -> float:
    """A quantity in SI units.

    Args:
        value: a string of number and unit, or a number, which is SI already.
        dimension: a key of UNITS.

    Raises:
        UnitError: not a quantity, not finite, unit missing, unknown, or of another dimension.
    """
    if isinstance(value, str):
        return _parse_text(value, dimension)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise UnitError(f"expected {_example(dimension)}; found {value!r}")
    if not math.isfinite(value):
        raise UnitError(f"expected a finite {dimension}; found {value}")
    return float(value)


def _parse_text(text: str, dimension: str) -> float:
    match = _QUANTITY.fullmatch(text)
    if match is None:
        raise UnitError(f"expected {_example(dimension)}; found {text!r}")
    number, unit = match.groups()
    if not unit:
        raise UnitError(f'unit missing in {text!r}; write for example "{number} {_usual(dimension)}"')
    result = float(number) * unit_factor(unit, dimension)
    if not math.isfinite(result):
        raise UnitError(f"expected a finite {dimension}; found {text!r}")
    return result


def unit_factor(unit: str, dimension: str = "length") -> float:
    """How many SI units one `unit` is.

    Raises:
        UnitError: the unit is unknown or measures something else.
    """
    units = UNITS[dimension]
    if unit in units:
        return units[unit]
    for other, names in UNITS.items():
        if unit in names:
            raise UnitError(f"{unit!r} is a unit of {other}, not of {dimension}; possible: {', '.join(units)}")
    # one letter off in a unit of two is no close match by length, yet the likeliest slip
    near = [name for name in units if name.lower() == unit.lower()]
    near = near or [name for name in units if _one_key_off(unit, name)] or get_close_matches(unit, units, n=1)
    hint = f" did you mean {' or '.join(map(repr, near))}?" if near else ""
    raise UnitError(f"unknown unit of {dimension} {unit!r};{hint} possible: {', '.join(units)}")


def _one_key_off(one: str, other: str) -> bool:
    """True if two names of one length differ in a single letter, or in the order of two."""
    if len(one) != len(other) or len(one) < 2:
        return False
    wrong = [k for k, (a, b) in enumerate(zip(one, other, strict=True)) if a != b]
    swapped = len(wrong) == 2 and one[wrong[0]] + one[wrong[1]] == other[wrong[1]] + other[wrong[0]]
    return len(wrong) == 1 or swapped


def parse_length(value: object) -> float:
    """Metres from "0.65 mm" or from a number in metres."""
    return parse_quantity(value, "length")


def parse_angle(value: object) -> float:
    """Radians from "1 deg" or from a number in radians."""
    return parse_quantity(value, "angle")


def parse_rate(value: object) -> float:
    """Hertz from "5 kHz" or from a number in hertz."""
    return parse_quantity(value, "rate")


def parse_speed(value: object) -> float:
    """Metres per second from "30 mm/s" or from a number in m/s."""
    return parse_quantity(value, "speed")


def parse_force(value: object) -> float:
    """Newtons from "1 N" or from a number in newtons."""
    return parse_quantity(value, "force")


def parse_time(value: object) -> float:
    """Seconds from "10 min" or from a number in seconds."""
    return parse_quantity(value, "time")


def _usual(dimension: str) -> str:
    """The unit that a message offers as an example."""
    return {"length": "mm", "angle": "deg", "rate": "kHz", "speed": "mm/s", "force": "N", "time": "s"}[dimension]


def _example(dimension: str) -> str:
    return f'a {dimension} like "1 {_usual(dimension)}" or a number in {SI[dimension]}'


# s; from so many on, durations are told in days, and in years
DAY, YEAR = 86400.0, 365.25 * 86400.0
LONG_IN_DAYS, LONG_IN_YEARS = 4.0, 2.0


def seconds_text(seconds: float) -> str:
    """A duration: "12 ms", "3.4 s", "2 min 05 s", "3 h 20 min", "12 days", "8 years"."""
    if not math.isfinite(seconds):
        return UNKNOWN_TEXT
    if seconds < 0.0995:
        return f"{1e3 * seconds:.2g} ms" if seconds >= 1e-4 else "under 0.1 ms"
    if seconds < 99.5:
        return f"{seconds:.3g} s" if seconds < 9.95 else f"{seconds:.0f} s"
    if seconds >= LONG_IN_DAYS * DAY:
        return f"{seconds / DAY:.0f} days" if seconds < LONG_IN_YEARS * YEAR else f"{seconds / YEAR:,.0f} years"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest:02d} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60:02d} min"


def count_text(count: int, singular: str, plural: str = "") -> str:
    """ "no ridge", "1 ridge", "12 ridges"."""
    if count == 1:
        return f"1 {singular}"
    return f"{count or 'no'} {plural or singular + 's'}"
