"""Feature: a detail of the object finer than its global model, and its values; Dropped, and LeftOut."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from mapping.arrays import FloatArray
from mapping.errors import UNKNOWN_TEXT
from mapping.posterior import Posterior

# Log Bayes factor below which evidence is "barely worth mentioning" (Jeffreys, Theory of Probability, 1961, appendix
# B): what was sought in many places has odds against it before.
SUBSTANTIAL = 0.5 * math.log(10.0)
# Standard deviations of a Gaussian to its 95 % quantile
NORMAL_QUANTILE_95 = 1.6448536
LENGTH_UNITS = ((1.0, "m"), (1e-3, "mm"), (1e-6, "µm"), (1e-9, "nm"))
# A lower bound below this share of the upper one reads as none
NEXT_TO_NOTHING = 0.02


def length_unit(size: float) -> tuple[float, str]:
    """The unit (in metres, name) in which a length reads between 0.1 and 1000; metres from 1 m on."""
    for factor, name in LENGTH_UNITS:
        if abs(size) >= (1.0 if name == "m" else 0.1 * factor):
            return factor, name
    return LENGTH_UNITS[-1] if size else LENGTH_UNITS[1]


def length_text(value: float, digits: int = 3) -> str:
    """A length such as "0.65 mm", to so many significant digits."""
    if not math.isfinite(value):
        return UNKNOWN_TEXT
    factor, name = length_unit(value)
    return f"{_rounded(value / factor, digits)} {name}"


def place_decimals(tip_radius: float) -> int:
    """Decimals of a millimetre that tell places apart: two features a hundredth of the tip's radius apart are one."""
    return max(0, math.ceil(round(-math.log10(10.0 * tip_radius), 9)))  # rounded, so that 10 mm are one decimal


def place_text(point: Sequence[float] | FloatArray, tip_radius: float) -> str:
    """A place such as "(12, -4.9, 0) mm", as finely as a tip of that radius (m) tells places apart."""
    decimals = place_decimals(tip_radius)
    values = (round(1e3 * float(value), decimals) + 0.0 for value in point)  # + 0.0: no "-0.0"
    return f"({', '.join(f'{value:.{decimals}f}' for value in values)}) mm"


def _unit(name: str) -> tuple[float, str]:
    units = {"um": 1e-6} | {known: factor for factor, known in LENGTH_UNITS}
    if name not in units:
        raise ValueError(f"{name!r} is not a unit of length that a value is written in; possible: {', '.join(units)}")
    return units[name], name


def _unsigned(value: float, places: int) -> float:
    """Rounded, and never a zero with a sign."""
    return round(value, places) + 0.0


def _rounded(value: float, digits: int) -> str:
    if value == 0.0:
        return "0"
    places = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    text = f"{value:.{places}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


@dataclass(frozen=True)
class Interval:
    """A value with its central 90 % interval: 5 %, 50 % and 95 % quantiles (SI units).

    `censored` is True where the data only bound the value's size from below: "at least low", of a depth, which is
    negative, "high or deeper". With `bounded`, too, it is bounded from above as well ("between low and high"): any
    value within is as good, and the median is none of its own.

    As a number it is its median: `interval > 1e-3` compares that, and so does sorting; `interval.low > 1e-3` asks for
    95 % certainty. As text it reads "0.65 mm (0.64 to 0.66)"; `f"{interval:um}"` chooses the unit.
    """

    median: float
    low: float
    high: float
    censored: bool = False
    bounded: bool = False

    @classmethod
    def from_draws(cls, draws: FloatArray) -> Interval:
        """The interval of posterior draws (S,)."""
        low, median, high = np.quantile(np.asarray(draws, dtype=np.float64), [0.05, 0.5, 0.95])
        return cls(float(median), float(low), float(high))

    @classmethod
    def normal(cls, mean: float, sd: float) -> Interval:
        """The interval of a Gaussian."""
        return cls(float(mean), float(mean - NORMAL_QUANTILE_95 * sd), float(mean + NORMAL_QUANTILE_95 * sd))

    def with_doubt(self, sd: float) -> Interval:
        """The same value with a further, independent, Gaussian doubt of so much; a bound moves by as much."""
        low, high = (abs(end - self.median) for end in (self.low, self.high))
        more = NORMAL_QUANTILE_95 * sd
        return replace(self, low=self.median - math.hypot(low, more), high=self.median + math.hypot(high, more))

    def text(self, unit: str = "") -> tuple[str, str]:
        """The median with its unit, and the 90 % range ("0.64 to 0.66", or ""); a bound has none: "at least 0.64 mm",
        and of a depth, which is negative, "-0.64 mm or deeper".

        Args:
            unit: of length; "": the one that fits.

        Raises:
            ValueError: not a unit of length.
        """
        if not math.isfinite(self.median):
            return UNKNOWN_TEXT, ""
        factor, name = _unit(unit) if unit else length_unit(self.high if self.bounded else self.median)
        if self.bounded:
            high = f"{_rounded(self.high / factor, 2)} {name}"
            nothing = abs(self.low) < NEXT_TO_NOTHING * self.high
            return (f"at most {high}" if nothing else f"between {_rounded(self.low / factor, 2)} and {high}"), ""
        if self.censored and self.median < 0.0:
            return f"{_rounded(self.high / factor, 3)} {name} or deeper", ""
        if self.censored:
            return f"at least {_rounded(self.low / factor, 3)} {name}", ""
        spread = self.high - self.low
        if not math.isfinite(spread) or spread <= 0.0:
            return f"{_rounded(self.median / factor, 3)} {name}", ""
        # Two digits of the half width: what is beyond is noise.
        places = max(0, 1 - math.floor(math.log10(0.5 * spread / factor)))
        low, median, high = (
            f"{_unsigned(value / factor, places):.{places}f}" for value in (self.low, self.median, self.high)
        )
        return f"{median} {name}", f"{low} to {high}"

    def __format__(self, unit: str) -> str:
        median, span = self.text(unit)
        return f"{median} ({span})" if span else median

    def __str__(self) -> str:
        return format(self, "")

    def __float__(self) -> float:
        return self.median

    def __lt__(self, other: Interval | float) -> bool:
        return self.median < float(other)

    def __le__(self, other: Interval | float) -> bool:
        return self.median <= float(other)

    def __gt__(self, other: Interval | float) -> bool:
        return self.median > float(other)

    def __ge__(self, other: Interval | float) -> bool:
        return self.median >= float(other)


@dataclass(frozen=True, eq=False)
class Anchor:
    """Where a feature hangs on the base mesh.

    Args:
        face: index of the base face under the feature's reference point.
        barycentric: (3,) coordinates of that point in the face.
        position: (3,) the point, m.
        frame: (3, 3) rows tangent (along the axis), binormal, outward normal.
    """

    face: int
    barycentric: FloatArray
    position: FloatArray
    frame: FloatArray


@dataclass(frozen=True, eq=False)
class Support:
    """Why the feature is believed.

    Args:
        snr: signal-to-noise ratio of all crossings together (matched filter).
        crossings: number of crossings by sweeps.
        algorithms: numbers of the paper's algorithms (figure 4) that report it.
        log_odds: log Bayes factor of the feature against nothing (the bare base and its neighbours), or None.
    """

    snr: float
    crossings: int
    algorithms: tuple[int, ...] = ()
    log_odds: float | None = None

    @property
    def likely(self) -> bool:
        """False if all sweeps together hardly speak for it: a false alarm that later ones passed by."""
        return self.log_odds is None or self.log_odds >= SUBSTANTIAL


@dataclass(frozen=True, eq=False)
class Details:
    """What only some features have, and other stages compute with; None where it is not known. Kept in JSON's "extra".

    Args:
        trace_curvature: of the trace over the crest, 1/m.
        radius: of a protruding section's cap, m.
        scale, exponent: of a bump of revolution whose flank runs out (m, 1).
        taper, bottom: of a hollow whose walls run out without an edge (1, and the depth that they lead to, m); scale is
            then its half width at half of that.
        top, run, shoulder: width of a flat top, and the run of each flank beside it or the radius of its edges, m.
        end_rounding: of the ends of a line with a flat top or bottom, in plan: 0 square, 1 a half circle.
        misfit: in which way no family of its kind fits it, in words.
        axis_sd: (K,) standard deviation of the axis across itself, at even steps along it, m.
        end_intervals: (2, 2) 90 % interval of the first and the last end along the axis, m, from where it is stated.
        ends_seen: whether the data say that the axis does not go on there.
        account: what it and what is felt together with it may be, in words, with the probability of each, where more
            than one is likely.
        high_side: of a step, +1 if the side of normal x tangent (along the axis) is the higher one, else -1.
        free_section: True of a detail so wide that the trace over it is its surface: measured there, no family fitted.
    """

    trace_curvature: float | None = None
    radius: float | None = None
    scale: float | None = None
    exponent: float | None = None
    taper: float | None = None
    bottom: float | None = None
    top: float | None = None
    run: float | None = None
    shoulder: float | None = None
    end_rounding: float | None = None
    misfit: str | None = None
    axis_sd: FloatArray | None = None
    end_intervals: FloatArray | None = None
    ends_seen: tuple[bool, bool] | None = None
    high_side: float | None = None
    account: tuple[tuple[str, float], ...] | None = None
    free_section: bool | None = None

    def known(self) -> dict[str, Any]:
        """What is known, by name."""
        values = {each.name: getattr(self, each.name) for each in fields(self)}
        return {name: value for name, value in values.items() if value is not None}

    def or_of(self, other: Details) -> Details:
        """These, and from the other what is not known here."""
        return replace(other, **self.known())

    @classmethod
    def read(cls, record: Mapping[str, Any]) -> Details:
        """The details among the values of a record."""
        found = {each.name: record[each.name] for each in fields(cls) if record.get(each.name) is not None}
        for name in ("axis_sd", "end_intervals"):
            if name in found:
                found[name] = np.array(found[name], dtype=np.float64)
        if "ends_seen" in found:
            first, last = found["ends_seen"]
            found["ends_seen"] = (bool(first), bool(last))
        if "account" in found:
            found["account"] = tuple((str(words), float(share)) for words, share in found["account"])
        return cls(**found)


@dataclass(frozen=True, eq=False, repr=False)
class Feature:
    """One fine surface feature on the base.

    Args:
        kind: name of its kind, one of `KINDS` (mapping/inference/kinds/kind.py).
        axis: (K, 3) points on the base surface under the crest, m; K = 1 for bumps and pits;
            first equals last for a closed ridge.
        normals: (K, 3) outward unit normals of the base at the axis.
        height: signed height of the crest over the base, m (negative for pits and grooves).
        width: full width of the detail on the body, m.
        length: length along the axis, m (zero-width interval at 0 for a point feature).
        evidence: signal-to-noise and crossings.
        curvature_feature: True if it meets definition 1 of the paper at this tip radius (finer than the
            tip); False if it merely stands out of the noise.
        position_sd: standard deviation of the axis across itself, m.
        posterior: draws of the shape's parameters, or None before sampling.
        anchor: where it hangs on the base, or None before attachment.
        id: name within its model, "" before attachment.
        notes: remarks for people, for example why a value is censored; nothing is computed from them.
        extra: further JSON values for the model's file; nothing is computed from them.
        junction: True for one of several lines that meet.
        faint: True of a line that no single sweep showed.
        details: what only some features have.
    """

    kind: str
    axis: FloatArray
    normals: FloatArray
    height: Interval
    width: Interval
    length: Interval
    evidence: Support
    curvature_feature: bool
    position_sd: float
    posterior: Posterior | None = None
    anchor: Anchor | None = None
    id: str = ""
    notes: tuple[str, ...] = ()
    extra: dict[str, Any] = field(default_factory=dict)
    junction: bool = False
    faint: bool = False
    details: Details = Details()

    def __repr__(self) -> str:
        sizes = (("height", self.height), ("width", self.width), ("length", self.length))
        text = ", ".join(f"{name} {size}" for name, size in sizes if name == "height" or size.high > 0.0)
        return f"<{self.id or self.kind}: {text}>"

    def plot(self, axes: Any = None) -> Any:
        """Draw height, width and length with their 90 % intervals; `posterior.plot()` draws what is behind them.

        Args:
            axes: of matplotlib, to draw into; None: new ones.

        Returns:
            The axes.
        """
        if axes is None:
            import matplotlib.pyplot as plt

            _, axes = plt.subplots(figsize=(6.0, 2.4), layout="constrained")
        sizes = {name: getattr(self, name) for name in ("height", "width", "length")}
        known = {name: size for name, size in sizes.items() if math.isfinite(size.median) and size.high != size.low}
        for place, size in enumerate(known.values()):
            unit = abs(size.median) or 1.0  # each on its own scale: a ridge is a hundred times longer than high
            axes.plot([size.low / unit, size.high / unit], [place, place], color="#b91c1c", linewidth=6, alpha=0.35)
            axes.plot([size.median / unit], [place], "o", color="#b91c1c")
            axes.annotate(str(size), (size.median / unit, place), (0, 9), textcoords="offset points", ha="center")
        axes.set_yticks(range(len(known)), list(known))
        axes.set_ylim(-0.6, len(known) - 0.2)
        axes.margins(x=0.3)
        axes.set_xlabel("share of the median")
        axes.set_title(self.id or self.kind)
        return axes

    @property
    def closed(self) -> bool:
        """True for a ridge or groove that returns to its beginning."""
        return len(self.axis) > 2 and bool(np.array_equal(self.axis[0], self.axis[-1]))


@dataclass(frozen=True, eq=False)
class Dropped:
    """Something that was detected, and is no feature of the model.

    Args:
        kind: of the feature that it was taken for, or of the lone crossing ("convex", "concave", "step up", "step
            down").
        point: (3,) place on the base, m.
        height: signed height over the base, m.
        snr: signal-to-noise ratio of all its crossings together (matched filter).
        crossings: number of crossings by sweeps.
        log_odds: log Bayes factor against nothing, or None if it was dropped before that was asked.
        reason: one sentence saying why.
    """

    kind: str
    point: FloatArray
    height: float
    snr: float
    crossings: int
    log_odds: float | None
    reason: str


@dataclass(frozen=True)
class LeftOut:
    """One stage that was not needed or could not be done.

    Args:
        stage: name of the stage, for example "contact algorithms".
        reason: one sentence saying why.
        saved: what leaving it out saved, in words ("" if not known).
    """

    stage: str
    reason: str
    saved: str = ""
