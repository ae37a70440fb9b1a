"""Units of length and of time as headers spell them, and names of columns without their units."""

from __future__ import annotations

import re

from explore3d import UNITS

# Metres of every spelling, in lower case; what UNITS knows is found there
_LENGTHS = {
    1.0: "m meter meters metre metres",
    1e-1: "dm",
    1e-2: "cm centimeter centimeters centimetre centimetres",
    1e-3: "mm millimeter millimeters millimetre millimetres milimeter",
    1e-6: "um µm μm µ μ mum micron microns micrometer micrometers micrometre micrometres mikrometer",
    1e-9: "nm nanometer nanometers nanometre nanometres",
    1e-10: "å a angstrom angstroms ångström ångstrom angström ang",
    1e-12: "pm picometer picometers picometre picometres",
    25.4e-3: 'in inch inches " ″ zoll',
    25.4e-6: "mil mils thou thous",
    25.4e-9: "uin µin μin microinch microinches",
    304.8e-3: "ft foot feet",
}
LENGTH_SPELLINGS = {name: factor for factor, names in _LENGTHS.items() for name in names.split()}
_TIMES = {
    1.0: "s sec secs second seconds",
    1e-3: "ms msec millisecond milliseconds",
    1e-6: "us µs μs usec microsecond microseconds",
    1e-9: "ns nsec nanosecond nanoseconds",
    60.0: "min mins minute minutes",
    3600.0: "h hr hour hours",
}
TIME_SPELLINGS = {name: factor for factor, names in _TIMES.items() for name in names.split()}
NO_UNIT = frozenset(("", "-", "1", "--", "1/0", "0/1", "n/a", "none", "bool", "#", "a.u."))

_BRACKETED = re.compile(r"^(?P<name>.*?)\s*[\[({<]\s*(?:unit[s]?\s*[:=]\s*)?(?P<unit>[^\])}>]*?)\s*[\])}>]\s*$")
_SLASHED = re.compile(r"^(?P<name>.*\S)\s*/\s*(?P<unit>[^\s/\d][^\s/]*)\s*$")
_LOOSE = re.compile(r"^(?P<name>.*?[^\s,:_])(?:\s+in\s+|\s*[,:]\s*|\s+|_)(?P<unit>[^\s,:_]+)\s*$")


def length_factor(unit: str) -> float | None:
    """Metres that one `unit` is, however it is spelled; None if it is no length."""
    if unit in UNITS["length"]:
        return UNITS["length"][unit]
    power = re.fullmatch(r"(?:1\s*e|10\s*\^?\s*)([-+\u2212]?\d+)\s*(m|meters?|metres?)", unit.strip().lower())
    if power:
        return float(f"1e{int(power[1])}")
    return LENGTH_SPELLINGS.get(unit.strip().strip(".").lower())


def time_factor_of(unit: str) -> float | None:
    """Seconds that one `unit` is; None if it is no time."""
    return UNITS["time"].get(unit, TIME_SPELLINGS.get(unit.strip().strip(".").lower()))


def name_and_unit(cell: str) -> tuple[str, str]:
    """("x", "mm") from "x [mm]", "x (mm)", "x/mm", "x_mm", "x in mm", "x, mm"; the unit is "" if none is stated."""
    cell = cell.strip().strip("'").strip()
    for pattern in (_BRACKETED, _SLASHED):
        if hit := pattern.match(cell):
            return hit["name"].strip(), hit["unit"].strip()
    hit = _LOOSE.match(cell)
    # only a true unit is cut off a name: "Total Profile" and "x_a" are names
    if hit and (length_factor(hit["unit"]) or time_factor_of(hit["unit"])) and len(hit["unit"]) > 1:
        return hit["name"].strip(), hit["unit"]
    return cell, ""


def is_unit(cell: str) -> bool:
    """True if a whole cell is nothing but a unit, or says that there is none."""
    bare = cell.strip("[](){}<> ")
    known = bare.lower() in NO_UNIT or any(bare in units for units in UNITS.values())
    return (
        known
        or length_factor(bare) is not None
        or time_factor_of(bare) is not None
        or (cell[:1] in "[(" and not cell[:1].isalnum())
    )
