"""What the values of a table tell by themselves: which mean "none", in what order they stand, where sweeps begin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import BoolArray, FloatArray, IntArray

JUMP = 10.0  # median steps: noise alone never makes a step so long, a lifted finger nearly always does
# Numbers that programs write where there is none: of nines, the ends of integers, powers of ten that no length has
_NINES = (999, 9999, 99999, 999999, 999.9, 9999.9, 999.99, 999.999)
_INTEGERS = (32767, 32768, 65535, 2147483647, 2147483648, 4294967295)
_HUGE = (1e10, 1e20, 1e30, 1e31, 1e36, 1e37, 1e38, 9.96921e36, 3.4028235e38)
SENTINELS = np.sort([sign * value for value in (*_NINES, *_INTEGERS, *_HUGE) for sign in (-1, 1)])
LEAST_SENTINEL = float(np.abs(SENTINELS).min())
_KNOWN = frozenset(SENTINELS.tolist())
OUTSIDE = 0.5  # of the range of the others: a sentinel of that kind stands off by more
LONELY = 5.0  # ranges of the others: a value that repeats and is no known sentinel must stand off by more
FEWEST = 7  # rows that show what is usual: fewer have no value far off all others
REPEATED = 0.5  # most rows of what is flat, read without noise, are as the row before
REPEATS = 3  # such a value comes so often at least: two equal outliers may be chance
TURN = 0.1  # of the extent along the rows: less is noise or a start, not the end of a row
STRAIGHT = 0.3  # a row strays sideways by less of its own length; a half circle by 0.5
ADVANCE = 0.7  # net advance per path: noise takes a little of it, there and back leaves half
SHORT_ROW = 4  # samples: zigzags of fewer are noise, or rows in no order
DISORDER = 10.0  # a usual step that is so many times the distance to the nearest point is no finger's
MOST_STEPS = 100_000  # steps that tell the direction of the rows
WIDE = 0.1  # of the extent: the steps of points in no order are longer


@dataclass(frozen=True)
class Order:
    """Rows as sweeps.

    Args:
        rows: (N,) the rows in the order of movement; None: as they stand.
        sweep: (N,) number of each one's sweep.
        said: what was recognised, "" if the rows stand as one expects.
    """

    rows: IntArray | None
    sweep: IntArray
    said: str = ""


def sentinels(values: FloatArray) -> BoolArray:
    """(N,) mask of the numbers of one column that mean "none": far off all others, and known as such or repeated."""
    if _plain(values):
        return np.zeros(len(values), dtype=np.bool_)
    finite = np.isfinite(values)
    known: BoolArray = np.zeros(len(values), dtype=np.bool_)
    if np.max(np.abs(values), where=finite, initial=0.0) >= LEAST_SENTINEL:
        near = np.minimum(np.searchsorted(SENTINELS, values), len(SENTINELS) - 1)
        known = finite & ((SENTINELS[near] == values) | (np.abs(values) >= 1e30))
    usual = finite & ~known
    count = np.count_nonzero(usual)
    found: BoolArray = np.zeros(len(values), dtype=np.bool_)
    if count < FEWEST:
        return found
    low, high = _range(values, usual)
    room = OUTSIDE * (high - low)
    if known.any():
        found |= known & ((values < low - room) | (values > high + room))
    if count < 4 * REPEATS:
        return found
    for extreme, side in ((low, 1.0), (high, -1.0)):
        same = values == extreme
        others = usual & ~same
        left = np.count_nonzero(others)
        if np.count_nonzero(same) < REPEATS or left < count // 2 or not left:
            continue
        least, most = _range(values, others)
        gap = least - extreme if side > 0 else extreme - most
        if gap > LONELY * (most - least) > 0 and not _is_level(values, same, others):
            found |= same
    return found


def _is_level(values: FloatArray, same: BoolArray, others: BoolArray) -> bool:
    """True of a value that repeats from row to row where the others do so as well: what is flat was read without noise.

    Below a wall that is higher than the tip's radius no reading is near those above it.
    """
    again = np.append(False, values[1:] == values[:-1])
    return all(np.count_nonzero(again & own) > REPEATED * np.count_nonzero(own) for own in (same, others))


def _range(values: FloatArray, which: BoolArray) -> tuple[float, float]:
    """The least and the greatest of some values."""
    low = float(np.min(values, where=which, initial=np.inf))
    return low, float(np.max(values, where=which, initial=-np.inf))


def _plain(values: FloatArray) -> bool:
    """True if nothing can mean "none": all are numbers, and neither extreme is known as such or repeats.

    Whatever stands far off all others is an extreme, so that most columns need no closer look.
    """
    if not len(values):
        return True
    for extreme in (float(values.min()), float(values.max())):
        if not abs(extreme) < 1e30 or extreme in _KNOWN or np.count_nonzero(values == extreme) >= REPEATS:
            return False
    return True


def clipped(values: FloatArray) -> str:
    """A word on an extreme that repeats as no other value does: the end of an instrument's range, perhaps."""
    if len(values) < 50:
        return ""
    if max(np.count_nonzero(values == extreme) for extreme in (values.min(), values.max())) < 5 * REPEATS:
        return ""
    unique, count = np.unique(values, return_counts=True)
    if len(unique) < len(values) // 4:
        return ""  # numbers of few digits repeat everywhere
    for at, word in ((0, "least"), (-1, "greatest")):
        if count[at] >= max(5 * REPEATS, 5 * np.median(count)):
            return f"its {word} value {unique[at]:g} stands in {count[at]} rows: the end of the range?"
    return ""


def profile_order(x: FloatArray) -> Order:
    """One sweep along x; several where x turns back; sorted by x if the rows are in no order."""
    count = len(x)
    steps = np.diff(x)
    one = np.zeros(count, dtype=np.int64)
    if (steps >= 0).all() or (steps <= 0).all():
        return Order(None, one)
    length, path = float(np.ptp(x)), float(np.abs(steps).sum())
    if length > ADVANCE * path:
        back = int(min((steps > 0).sum(), (steps < 0).sum()))
        return Order(None, one, f"x steps back {back} times")
    turns = turning_points(x, TURN * length)
    sweep = _cut(count, turns)
    if count >= SHORT_ROW * (sweep[-1] + 1) and _progress(x, sweep) > ADVANCE and _overlap(x, sweep):
        return Order(None, sweep, f"x turns back {sweep[-1]} times: {sweep[-1] + 1} sweeps")
    order = np.argsort(x, kind="stable")
    return Order(order, one, "the rows stood in no order and are sorted by x")


def _overlap(x: FloatArray, sweep: IntArray) -> bool:
    """True if any two sweeps share a part of x: parts side by side are one sweep, in a wrong order."""
    starts = np.flatnonzero(np.diff(sweep, prepend=-1))
    low, high = np.minimum.reduceat(x, starts), np.maximum.reduceat(x, starts)
    order = np.argsort(low)
    return bool((np.maximum.accumulate(high[order])[:-1] > low[order][1:]).any())


def _progress(x: FloatArray, sweep: IntArray) -> float:
    """Net advance of the sweeps per path within them."""
    inside = np.diff(sweep) == 0
    path = float(np.abs(np.diff(x))[inside].sum())
    starts = np.flatnonzero(np.diff(sweep, prepend=-1))
    ends = np.append(starts[1:], len(x)) - 1
    return float(np.abs(x[ends] - x[starts]).sum()) / path if path > 0 else 0.0


def cloud_order(points: FloatArray, jump: float | None) -> Order | None:
    """Sweeps of points: cut at each jump, or where straight rows turn; None if the points are in no order.

    A wall higher than the ball is climbed from one sample to the next: a step aside is no jump of a row that goes on.
    """
    steps = np.sqrt(sum(np.diff(column) ** 2 for column in points.T))
    moving = steps[steps > 0]
    if jump is not None or not len(moving):
        return Order(None, _counted(steps > (np.inf if jump is None else jump)))
    if _disordered(points, moving):
        return None
    longest = JUMP * float(np.median(moving[:: len(moving) // 100_000 * 2 + 1]))
    jumps, turned = steps > longest, _rows_that_turn(points)
    if turned is not None:  # within a row that goes on as before a ball climbed a wall
        jumps &= (np.diff(turned) > 0) | (np.abs(np.diff(points @ _main_direction(points))) > longest)
    if turned is None or turned[-1] <= jumps.sum():
        return Order(None, _counted(jumps))
    sweep = _counted(jumps | (np.diff(turned) > 0))
    u = points @ _main_direction(points)
    starts = np.flatnonzero(np.diff(turned, prepend=-1))
    ends = np.append(starts[1:], len(points)) - 1
    signs = np.sign(u[ends] - u[starts])
    both = bool((signs[1:] * signs[:-1] < 0).mean() > 0.5)
    said = "rows to and fro" if both else "rows one way"
    return Order(None, sweep, f"{said}, cut where they turn: {sweep[-1] + 1} sweeps")


def _counted(cuts: BoolArray) -> IntArray:
    return np.concatenate([[0], np.cumsum(cuts)]).astype(np.int64)


def _main_direction(points: FloatArray) -> FloatArray:
    """The direction of most steps, short or long: the step from row to row may be longer than those along a row."""
    some = points[: MOST_STEPS + 1]
    steps: FloatArray = some[1:] - some[:-1]
    lengths = np.sqrt(np.sum(steps**2, axis=1))[:, None]
    unit = np.divide(steps, lengths, out=np.zeros_like(steps), where=lengths > 0)
    direction: FloatArray = np.linalg.svd(unit.T @ unit)[2][0]
    return direction


def _rows_that_turn(points: FloatArray) -> IntArray | None:
    """(N,) number of the row if the points lie in straight rows along one direction, else None."""
    if len(points) < 4 * SHORT_ROW:
        return None
    direction = _main_direction(points)
    u = points @ direction
    off = [column - u * part for column, part in zip(points.T, direction, strict=True)]
    turns = turning_points(u, TURN * float(np.ptp(u)))
    # noise may move the turn by a sample: the longest step aside leads from row to row
    near = np.clip(turns[:, None] + np.array([-1, 0, 1]), 0, len(u) - 2)
    aside_steps = np.sqrt(sum((part[near + 1] - part[near]) ** 2 for part in off))
    single = np.isin(turns + 1, turns) | np.isin(turns - 1, turns)  # the step back of a raster one way
    best = near[np.arange(len(turns)), np.argmax(aside_steps, axis=1)]
    sweep = _cut(len(u), np.where(single, turns, best))
    rows = int(sweep[-1]) + 1
    if rows < 2 or len(u) < SHORT_ROW * rows or _progress(u, sweep) < ADVANCE:
        return None
    starts = np.flatnonzero(np.diff(sweep, prepend=-1))
    along = np.maximum.reduceat(u, starts) - np.minimum.reduceat(u, starts)
    widths = [np.maximum.reduceat(part, starts) - np.minimum.reduceat(part, starts) for part in off]
    aside = np.sqrt(sum(width**2 for width in widths))
    straight = aside < STRAIGHT * along
    full = along > 0.5 * np.median(along)
    return sweep if straight.mean() > 0.9 and full.mean() > 0.9 else None


def turning_points(u: FloatArray, least: float) -> IntArray:
    """Indices where u turns back by more than `least`: its extremes, one after the other."""
    turns: list[int] = []
    direction, extreme = 0, 0
    slope = np.sign(np.diff(u))
    bends = np.flatnonzero(slope[1:] != slope[:-1]) + 1
    kept = np.concatenate([[0], bends, [len(u) - 1]])  # no turning point lies between two bends
    values = u[kept].tolist()
    low = high = 0
    for index, value in enumerate(values):
        if direction == 0:
            low, high = (index if value < values[low] else low), (index if value > values[high] else high)
            if values[high] - values[low] > least:
                direction = 1 if high > low else -1
                extreme = high if high > low else low
                if min(high, low) > 0:
                    turns.append(min(high, low))
        elif direction * (value - values[extreme]) > 0:
            extreme = index
        elif direction * (values[extreme] - value) > least:
            turns.append(extreme)
            direction, extreme = -direction, index
    found: IntArray = kept[np.array(turns, dtype=np.int64)].astype(np.int64)
    return found


def _cut(count: int, turns: IntArray) -> IntArray:
    """(N,) number of the row when rows end at the turns; the single step back of a raster belongs to no row."""
    cuts = np.zeros(count - 1, dtype=np.bool_)
    skip = -1
    for turn in turns.tolist():
        if turn != skip and turn < count - 1:
            cuts[turn] = True
            skip = turn + 1
    return _counted(cuts)


def _disordered(points: FloatArray, steps: FloatArray) -> bool:
    """True if the usual step is as long as between points picked at random."""
    extent = float(np.linalg.norm(np.ptp(points, axis=0)))
    steps = steps[:: len(steps) // 100_000 * 2 + 1]
    usual = float(np.median(steps))
    if len(steps) < 50 or usual < WIDE * extent:
        return False
    low, high = float(np.quantile(steps, 0.1)), float(np.quantile(steps, 0.9))
    if high < 2.5 * low:  # steps all alike are a pattern, however wide
        return False
    from scipy.spatial import cKDTree

    some = points[:: max(1, len(points) // 2000)]
    nearest = np.asarray(cKDTree(points).query(some, 2)[0])[:, 1]
    return usual > DISORDER * float(np.median(nearest[nearest > 0]) if (nearest > 0).any() else 0.0)
