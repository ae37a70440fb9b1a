"""Profiles: scratches, slots, steps and humps under a stylus, on a rough and drifting profile; are they found and true?

The trace is a dilation by brute force on a grid of 40 nm, none of the closed forms that the analysis rests on; what is
analysed is a table, as `explore3d analyze` reads it.

    explore3d bench profiles --seeds 10
    explore3d bench profiles --seeds 10 --rows 16

Of a raster each row is such a profile of three millimetres; the detail crosses the rows between its ends at a slant.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import explore3d
from mapping import Feature, FloatArray, Interval
from mapping.inference.kinds import kind_made_of, kind_named

STYLUS, GRID_PITCH, GRID_PER_SAMPLE, PROFILE_LENGTH = 2e-6, 40e-9, 25, 10e-3
# Roughness correlated over 20 um, white noise, and a random walk from sample to sample, m; slope of the whole
ROUGH_SD, CORRELATED_OVER, WHITE_SD, WALK_SD, PROFILE_TILT = 50e-9, 20e-6, 10e-9, 2e-9, 3e-3
# A raster: its rows' length and distance, how far the detail moves aside for a way across them, and the rows beyond its
# ends, m
RASTER_LENGTH, ROW_PITCH, MOST_ASIDE, ROWS_BESIDE = 3e-3, 40e-6, 0.5, 4
# Seeds that the analysis was built with lie below
FIRST_REPORTED = 3000
# A form: heights over places (m) from its middle, and what is to be found: kind, height and width (NaN: has none), m
Heights = Callable[[FloatArray], FloatArray]
Form = tuple[Heights, tuple[tuple[str, float, float], ...]]


def _slot(rng: np.random.Generator) -> Form:
    width, depth = rng.uniform(50e-6, 200e-6), rng.uniform(5e-6, 30e-6)
    return lambda u: np.where(np.abs(u) < 0.5 * width, -depth, 0.0), (("pit", -depth, width),)


def _scratch(rng: np.random.Generator) -> Form:
    width, depth = rng.uniform(30e-6, 80e-6), rng.uniform(8e-6, 20e-6)
    return lambda u: -np.maximum(0.0, depth * (1.0 - 2.0 * np.abs(u) / width)), (("pit", -depth, width),)


def _faint_scratch(rng: np.random.Generator) -> Form:
    width, depth = rng.uniform(8e-6, 30e-6), rng.uniform(0.5e-6, 2e-6)
    return lambda u: -np.maximum(0.0, depth * (1.0 - 2.0 * np.abs(u) / width)), (("pit", -depth, width),)


def _faint_hump(rng: np.random.Generator) -> Form:
    width, height = rng.uniform(8e-6, 30e-6), rng.uniform(0.5e-6, 2e-6)
    return lambda u: np.maximum(0.0, height * (1.0 - (2.0 * u / width) ** 2)), (("bump", height, width),)


def _burred(rng: np.random.Generator) -> Form:
    scratch, ((_, depth, width),) = _scratch(rng)
    height, sd = rng.uniform(2e-6, 6e-6), rng.uniform(5e-6, 10e-6)

    def heights(u: FloatArray) -> FloatArray:
        return scratch(u) + height * np.exp(-0.5 * ((np.abs(u) - 0.5 * width - 3.0 * sd) / sd) ** 2)

    return heights, (("bump", height, np.nan), ("pit", depth, width), ("bump", height, np.nan))


def _hump(rng: np.random.Generator) -> Form:
    width, height = rng.uniform(30e-6, 90e-6), rng.uniform(5e-6, 12e-6)
    return lambda u: np.maximum(0.0, height * (1.0 - (2.0 * u / width) ** 2)), (("bump", height, width),)


def _step(rng: np.random.Generator) -> Form:
    height = rng.uniform(0.5e-6, 10e-6)
    return lambda u: np.where(u > 0.0, height, 0.0), (("step", height, np.nan),)


def _on_an_arc(rng: np.random.Generator) -> Form:
    slot, found = _slot(rng)
    radius = rng.uniform(20e-3, 80e-3)
    return lambda u: slot(u) - u**2 / (2.0 * radius), found


def _bare(rng: np.random.Generator) -> Form:
    return lambda u: 0.0 * u, ()


def without_detail(name: str, seed: Sequence[int]) -> Heights:
    """The body of a form beyond the ends of its detail: the arc goes on where the slot does not."""
    if name != "slot on an arc":
        return _bare(np.random.default_rng(seed))[0]
    slot, arc = (make(np.random.default_rng(seed))[0] for make in (_slot, _on_an_arc))
    return lambda u: arc(u) - slot(u)


PROFILE_FORMS: dict[str, Callable[[np.random.Generator], Form]] = {
    "slot": _slot,
    "scratch": _scratch,
    "scratch with burrs": _burred,
    "hump": _hump,
    "faint scratch": _faint_scratch,
    "faint hump": _faint_hump,
    "step": _step,
    "slot on an arc": _on_an_arc,
    "bare": _bare,
}


def bench_profiles(forms: Sequence[str], seeds: range, rows: int = 1) -> Iterator[str]:
    """CSV lines: of each form the profiles, those right in kind and count, and sizes within their 90 % intervals.

    Args:
        rows: of a raster; 1: profiles.
    """
    yield "form,profiles,right,heights,heights_inside,widths,widths_inside,lengths,lengths_inside"
    for name in forms:
        right, heights, widths, lengths = 0, list[bool](), list[bool](), list[bool]()
        for seed in seeds:
            found, wanted, length = raster_trial(name, seed, rows) if rows > 1 else (*profile_trial(name, seed), np.nan)
            if [feature.kind for feature in found] != [kind for kind, _, _ in wanted]:
                continue
            right += 1
            for feature, (_, height, width) in zip(found, wanted, strict=True):
                if np.isfinite(length):
                    lengths.append(_holds(feature.length, length))
                heights.append(_holds(feature.height, height))
                if np.isfinite(width):
                    widths.append(_holds(feature.width, width))
        counts = [count for sizes in (heights, widths, lengths) for count in (len(sizes), sum(sizes))]
        yield ",".join([name, *map(str, [len(seeds), right, *counts])])


def profile_trial(name: str, seed: int) -> tuple[list[Feature], tuple[tuple[str, float, float], ...]]:
    """The features of one profile along it, as `explore3d analyze --quick` finds them, and what is there."""
    rng = np.random.default_rng([seed, *name.encode()])
    form, wanted = PROFILE_FORMS[name](rng)
    x, z = _felt(form, rng.uniform(0.3, 0.7) * PROFILE_LENGTH, rng)
    return _analysed(1e3 * np.column_stack([x, z]), "x [mm],z [mm]"), wanted


def raster_trial(name: str, seed: int, rows: int) -> tuple[list[Feature], tuple[tuple[str, float, float], ...], float]:
    """As `profile_trial`, of a raster of so many rows, and the detail's length between its ends, m (NaN: none)."""
    rng = np.random.default_rng([seed, rows, *name.encode()])
    form, wanted = PROFILE_FORMS[name](rng)
    beside = without_detail(name, [seed, rows, *name.encode()])
    aside, y = rng.uniform(-MOST_ASIDE, MOST_ASIDE), ROW_PITCH * (np.arange(rows) - 0.5 * (rows - 1))
    square, table = 1.0 / np.hypot(1.0, aside), list[FloatArray]()
    ends = ROW_PITCH * (0.5 * rows - ROWS_BESIDE + rng.uniform(-0.5, 0.5, 2)) * [-1.0, 1.0]
    for number, at in enumerate(y):
        crossed = form if ends[0] < at < ends[1] else beside
        x, z = _felt(crossed, 0.5 * RASTER_LENGTH + aside * at, rng, RASTER_LENGTH, square)
        table.append(np.column_stack([np.full(len(x), number), 1e3 * x, np.full(len(x), 1e3 * at), 1e3 * z]))
    found = _analysed(np.concatenate(table), "sweep,x [mm],y [mm],z [mm]")
    # what is a spot on a profile is a line across a raster
    lines = (kind_made_of(kind_named(kind).made_of, line=True).name for kind, _, _ in wanted)
    wanted = tuple((name, height, width) for name, (_, height, width) in zip(lines, wanted, strict=True))
    return found, wanted, float((ends[1] - ends[0]) / square) if wanted else np.nan


def _analysed(table: FloatArray, head: str) -> list[Feature]:
    """The features of a table, mm, along x, as `explore3d analyze --quick` finds them."""
    with TemporaryDirectory() as folder:
        path = Path(folder, "table.csv")
        np.savetxt(path, table, fmt="%.7f", delimiter=",", header=head, comments="")
        analysis = explore3d.analyze(path, tip_radius=STYLUS, quick=True)
    return sorted(analysis.model.features, key=lambda feature: float(feature.axis[:, 0].mean()))


def _felt(
    form: Heights,
    middle: float,
    rng: np.random.Generator,
    length: float = PROFILE_LENGTH,
    square: float = 1.0,
) -> tuple[FloatArray, FloatArray]:
    """Places and heights of a stylus that crosses a form at an angle of the sine `square`: a ball feels it across."""
    from scipy.ndimage import gaussian_filter1d

    x: FloatArray = GRID_PITCH * np.arange(int(length / GRID_PITCH), dtype=np.float64)
    pitch = square * GRID_PITCH
    reach = int(STYLUS / pitch)
    around = np.pad(form(square * (x - middle)), reach, mode="edge")
    trace = np.full(len(x), -np.inf)
    for k in range(-reach, reach + 1):
        ball = float(np.sqrt(max(STYLUS**2 - (pitch * k) ** 2, 0.0))) - STYLUS
        np.maximum(trace, around[reach + k : reach + k + len(x)] + ball, out=trace)
    x, trace = x[::GRID_PER_SAMPLE], trace[::GRID_PER_SAMPLE]
    rough = gaussian_filter1d(rng.standard_normal(len(x)), CORRELATED_OVER / (GRID_PITCH * GRID_PER_SAMPLE))
    noise = WHITE_SD * rng.standard_normal(len(x)) + WALK_SD * np.cumsum(rng.standard_normal(len(x)))
    return x, trace + ROUGH_SD * rough / rough.std() + noise + PROFILE_TILT * x


def _holds(interval: Interval, true: float) -> bool:
    low, high = sorted((abs(interval.low), abs(interval.high)))  # a step's sign is the side that it was come from
    return bool(low <= abs(true) <= high)
