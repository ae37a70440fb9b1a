"""Quantities as people read them: the unit that fits, and no more digits than are known."""

from __future__ import annotations

import math

from mapping.feature import Interval

LENGTH_UNITS = ((1.0, "m"), (1e-3, "mm"), (1e-6, "µm"), (1e-9, "nm"))
UNKNOWN = "–"


def length_unit(size: float) -> tuple[float, str]:
    """The unit (in metres, name) in which a length reads between 0.1 and 1000; metres from 1 m on."""
    for factor, name in LENGTH_UNITS:
        if abs(size) >= (1.0 if name == "m" else 0.1 * factor):
            return factor, name
    return LENGTH_UNITS[-1] if size else LENGTH_UNITS[1]


def length_text(value: float, digits: int = 3) -> str:
    """A length such as "0.65 mm", to so many significant digits."""
    if not math.isfinite(value):
        return UNKNOWN
    factor, name = length_unit(value)
    return f"{_rounded(value / factor, digits)} {name}"


def interval_text(interval: Interval) -> tuple[str, str]:
    """The median with its unit, and the 90 % range ("0.64 to 0.66"); censored ones read "at least"."""
    if not math.isfinite(interval.median):
        return UNKNOWN, ""
    factor, name = length_unit(interval.median)
    if interval.censored:
        return f"at least {_rounded(interval.low / factor, 3)} {name}", ""
    spread = interval.high - interval.low
    if not math.isfinite(spread) or spread <= 0.0:
        return length_text(interval.median), ""
    # Two digits of the half width: what is beyond is noise.
    places = max(0, 1 - math.floor(math.log10(0.5 * spread / factor)))
    low, median, high = (f"{value / factor:.{places}f}" for value in (interval.low, interval.median, interval.high))
    return f"{median} {name}", f"{low} to {high}"


def seconds_text(seconds: float) -> str:
    """A duration: "12 ms", "3.4 s", "2 min 05 s"."""
    if not math.isfinite(seconds):
        return UNKNOWN
    if seconds < 0.0995:
        return f"{1e3 * seconds:.2g} ms" if seconds >= 1e-4 else "under 0.1 ms"
    if seconds < 99.5:
        return f"{seconds:.3g} s" if seconds < 9.95 else f"{seconds:.0f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest:02d} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60:02d} min"


def count_text(count: int, singular: str, plural: str = "") -> str:
    """ "no ridge", "1 ridge", "12 ridges"."""
    if count == 1:
        return f"1 {singular}"
    return f"{count or 'no'} {plural or singular + 's'}"


def _rounded(value: float, digits: int) -> str:
    if value == 0.0:
        return "0"
    places = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    text = f"{value:.{places}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text
