"""Sound sweeps: a recorded path cut into pieces that advance, whatever numbers its sweeps bear.

The number that a recording gives a sweep is a hint only: a serpentine may be written under one number. Detection takes
heights over the length of a sweep, assembly takes sweeps for neighbours of each other. Both are right for a sweep that
advances; one that turns back, turns a corner, comes beside itself, or goes on elsewhere is several.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace

import numpy as np

from mapping import BoolArray, FloatArray, IntArray, Trace, lengths
from mapping.base import FEW_SAMPLES_PER_BIN, UNEVEN, Base, LaidSweep, LaidTrace
from mapping.detection import LADDER, smallest_crest
from mapping.detection.filters import FILTER_BINS_PER_HALF_WIDTH
from mapping.detection.path.rolled_out import RolledOut, rolled_out, runs_straight, usual_step

# A path that turns evenly by the angle a over the half-width w of a crest crosses it over w (1 + a^2 / 6). A turn is
# felt where that is more than half a step between the filters' half-widths.
SHARP_TURN = float(np.sqrt(6 * 0.5 * (LADDER - 1)))
# A turn lasts if the direction over so many times the reach has turned as well: a finger that slips back does not turn.
# Twice is the least at which half of what is compared lies beyond the turn's own reach
LASTING = 2
# A sweep whose directions lie within 60 degrees of one direction advances along it with half its length at least: it
# passes nothing twice and never runs beside itself.
WIDEST_RANGE = 2 * np.pi / 3
# An arc turns evenly: its direction stays within this of a steady turn, rad, half of what a sweep may turn to one side.
# It comes beside itself after once round; a circuit begins and ends within a quarter of a turn of that. A sweep may
# turn to one side by half of WIDEST_RANGE, and what swings about a steady turn by less than half of that keeps turning
# to that side in every stretch that a sweep may span.
EVEN_TURN, ONCE_ROUND = WIDEST_RANGE / 4, (1.5 * np.pi, 2.5 * np.pi)
# A step between samples is a jump if longer than so many usual ones. Steps of noise alone (Maxwell's law, median 1.54
# standard deviations) exceed five medians once in 1e12; a finger that starts, stops or rounds a corner goes more slowly
# than usual, not five times as fast.
JUMP_STEPS = 5.0
# Samples on either side of a step that tell whether it leads elsewhere: the median of five bears two thrown off
BESIDE_JUMP = 5


@dataclass(frozen=True, eq=False)
class SoundSweeps:
    """A trace whose sweep numbers are sound.

    Args:
        trace: the same samples; the very same trace if nothing had to be cut.
        cuts: (reason, number) of the places where sweeps were cut.
    """

    trace: LaidTrace
    cuts: tuple[tuple[str, int], ...] = ()


def sound_sweeps(trace: Trace, base: Base) -> SoundSweeps:
    """Cut sweeps where they turn back, turn a corner, come beside themselves, or go on elsewhere.

    A turn is judged along the base over the half-width of the smallest crest that the noise lets see, or over as much
    path as the noise of the positions needs to have a direction. An arc and a circuit stay whole.

    A run of samples keeps its number up to its first cut; further pieces get numbers above all that there are. A
    number that comes again later is another sweep.

    Args:
        trace: one or many sweeps, numbered in whatever way.
        base: the global model.
    """
    laid = LaidTrace.of(trace, base)
    steps = [usual_step(sweep.trace.centers) for sweep in laid.laid_sweeps]
    moving = [step for step in steps if step > 0]
    if not moving:
        return SoundSweeps(laid)
    usual = float(np.median(moving))
    reach = smallest_crest(laid, usual)
    if reach < FEW_SAMPLES_PER_BIN * FILTER_BINS_PER_HALF_WIDTH * usual:
        laid.feet()  # detection's bins are going to hold so few samples that each is asked for: blocks follow from them
    reasons: Counter[str] = Counter()
    numbers, seen, following = [], set[int](), int(trace.sweep.max()) + 1
    for sweep, step in zip(laid.laid_sweeps, steps, strict=True):
        cuts = _cuts(sweep, step, reach, reasons)
        number = sweep.number
        if number in seen:
            reasons["number given again"] += 1
        for k, samples in enumerate(np.diff([0, *cuts, len(sweep.trace)]).tolist()):
            if k > 0 or number in seen:
                number, following = following, following + 1
            seen.add(number)
            numbers.append(np.full(samples, number))
    if not reasons:
        return SoundSweeps(laid)
    sound = replace_sweeps(laid, np.concatenate(numbers))
    return SoundSweeps(sound, tuple(sorted(reasons.items())))


def replace_sweeps(laid: LaidTrace, numbers: IntArray) -> LaidTrace:
    """The samples under other numbers."""
    plain = laid.select(slice(None))
    return LaidTrace(replace(plain, sweep=numbers), laid.base)


def _cuts(sweep: LaidSweep, step: float, reach: float, reasons: Counter[str]) -> list[int]:
    """Samples, ascending, before which one run of samples is cut; counts what each cut is for."""
    part, base = sweep.trace, sweep.base
    if not step > 0:
        return []
    jumps = _jumps(part, base, reach)
    reasons.update({"jump": len(jumps)} if jumps else {})
    cuts = []
    for begin, end in zip([0, *jumps], [*jumps, len(part)], strict=True):
        cuts += [begin] if begin else []
        piece = part.select(slice(begin, end)) if jumps else part
        if len(piece) < 3 or runs_straight(piece.centers, reach, step, SHARP_TURN, WIDEST_RANGE):
            continue
        path = rolled_out(piece, base, step, max(reach, step), SHARP_TURN, sweep.known_feet(slice(begin, end)))
        if path is None:
            continue
        # round a plate's border, or round a wire's end: a circuit has corners, and is one sweep
        corners = [] if _is_circuit(path, 0, len(path.plane) - 1) else _corners(path)
        bends = _bends(path, corners)
        rounds = _rounds(path, sorted({*corners, *bends}))
        reasons.update({"turn": len(corners)} if corners else {})
        reasons.update({"beside itself": len(bends) + len(rounds)} if bends or rounds else {})
        # a block's mean lies in its middle
        cuts += [begin + int(path.first[k]) + path.size // 2 for k in sorted({*corners, *bends, *rounds})]
    return cuts


def _jumps(part: Trace, base: Base, reach: float) -> list[int]:
    """Samples before which the finger was set down elsewhere.

    A reading thrown off for a moment comes back, a crest that the ball climbs lifts it off the base only. A gap that
    the times tell of is no cut: detection cuts its heights there, and knows how long it is.
    """
    steps = lengths(np.diff(part.centers, axis=0))
    moving = steps[steps > 0]
    if len(moving) < 2:
        return []
    long = np.flatnonzero(steps > max(JUMP_STEPS * float(np.median(moving)), reach)) + 1
    # too few samples on one side tell no jump from readings thrown off
    long = long[(long > BESIDE_JUMP // 2) & (len(part) - long > BESIDE_JUMP // 2)]
    long = long[~_told(part)[long - 1]]
    if not len(long):
        return []
    # middles of five samples each: of the ten before the step and of the ten behind it
    first = long[:, None] + np.arange(BESIDE_JUMP)
    index = np.stack([first + k * BESIDE_JUMP for k in (-2, -1, 0, 1)]).clip(0, len(part) - 1)
    middles = np.median(part.centers[index], axis=2)
    feet = base.foot(middles.reshape(-1, 3), part.tip_radius)
    places = (feet.points + part.tip_radius * feet.normals).reshape(4, -1, 3)
    # a path that goes on, up a wall for instance, advances over the base as it did before or as it does behind
    before, over, behind = np.diff(places, axis=0)
    elsewhere = np.minimum(*(np.linalg.norm(over - usual, axis=1) for usual in (before, behind)))
    return [int(k) for k in long[elsewhere > reach]]


def _told(part: Trace) -> BoolArray:
    """(N - 1,) True of steps that took so long that samples were left out: arclength then goes by the times."""
    waited = np.diff(part.t)
    return np.asarray((waited > UNEVEN * waited.mean()) & (waited.min() > 0))


def _corners(path: RolledOut) -> list[int]:
    """Places, ascending, where the direction over the reach turns by more than SHARP_TURN, and stays turned."""
    bend, angle = path.turns(path.span)
    lasting = path.turns(LASTING * path.span)[1]
    # nearer than that to an end nothing tells whether it lasts
    sharp = (angle > SHARP_TURN) & ((lasting > SHARP_TURN) | (lasting == 0.0))
    if not sharp.any():
        return []
    around = np.lib.stride_tricks.sliding_window_view(np.pad(bend, path.span), 2 * path.span + 1).max(axis=1)
    chosen: list[int] = []
    for place in np.flatnonzero(sharp & (bend >= around)).tolist():
        if not chosen or place - chosen[-1] > path.span:
            chosen.append(place)
    return chosen


def _bends(path: RolledOut, corners: list[int]) -> list[int]:
    """Places where a path that bends smoothly would come beside itself.

    It is cut in the half of the allowed range that comes last, where the heights are flattest: not on a crest.
    """
    span, rough = path.span, _rough(path)
    cuts: list[int] = []
    for begin, end in zip([0, *corners], [*corners, len(path.plane) - 1], strict=True):
        if end - begin < 3 * span + 2:
            continue
        direction = path.directions(begin, end)
        if np.ptp(direction) <= WIDEST_RANGE or _is_arc(direction) or _is_circuit(path, begin, end):
            continue
        here = 0
        while (window := _beyond(direction, here)) is not None:
            first, last = window
            here = first + int(np.argmin(rough[begin + first : begin + last + 1]))
            cuts.append(begin + here + span // 2)
    return cuts


def _rough(path: RolledOut) -> FloatArray:
    """(K - span,) how far the path is off the base over each chord."""
    sums = np.concatenate([[0.0], np.cumsum(np.abs(path.height - np.median(path.height)))])
    return np.asarray((sums[path.span + 1 :] - sums[: -path.span - 1]) / (path.span + 1))


def _rounds(path: RolledOut, cuts: list[int]) -> list[int]:
    """Places where a path that winds round the body, straight on, would come beside itself.

    Nothing turns in the plane that it is rolled out into: the base's normal does. Once round, and a quarter, stays
    whole. It is cut in the second half of a round, where the heights are flattest.
    """
    span, rough = path.span, _rough(path)
    rounds: list[int] = []
    for begin, end in zip([0, *cuts], [*cuts, len(path.plane) - 1], strict=True):
        if np.ptp(path.round[begin : end + 1]) <= ONCE_ROUND[1]:
            continue
        here = begin
        while True:
            turned = np.maximum.accumulate(np.abs(path.round[here : end + 1] - path.round[here]))
            if turned[-1] <= 2.0 * np.pi:
                break
            first, last = (here + int(k) for k in np.searchsorted(turned, [np.pi, 2.0 * np.pi]))
            if not _comes_back(path, here, last):
                here = last
                continue
            # the chord about a place begins half a span before it
            low, high = max(first - span // 2, 0), max(last - span // 2, 1)
            here = max(low + int(np.argmin(rough[low:high])) + span // 2, here + 1)
            rounds.append(here)
    return rounds


def _comes_back(path: RolledOut, here: int, last: int) -> bool:
    """True of a path that once round has come back to a quarter of its way, or nearer.

    Over a body with waists and holes the normal turns as far on a way that leads on.
    """
    away = np.linalg.norm(path.places[last] - path.places[here])
    return bool(away < (ONCE_ROUND[1] / (2.0 * np.pi) - 1.0) * abs(path.plane[last] - path.plane[here]))


def _beyond(direction: FloatArray, here: int) -> tuple[int, int] | None:
    """The places between which directions that began `here` leave half of the allowed range, and all; None if never.

    That is WIDEST_RANGE, and half a turn of a path that turns steadily: a half-circle nowhere comes beside itself.
    """
    size = 64
    while True:
        part = direction[here : here + size]
        turned = np.maximum.accumulate(np.maximum.accumulate(part) - np.minimum.accumulate(part))
        ended = here + size >= len(direction)
        if turned[-1] > np.pi or (ended and turned[-1] > WIDEST_RANGE):
            half_round = part[: int(np.searchsorted(turned, np.pi, side="right"))]
            widest = np.pi if _is_steady(half_round) else WIDEST_RANGE
            if turned[-1] <= widest:
                return None
            first, last = np.searchsorted(turned, [widest / 2, widest])
            return here + max(int(first), 1), here + max(int(last), int(first), 1)
        if ended:
            return None
        size *= 2


def _is_steady(direction: FloatArray) -> bool:
    steady = np.linspace(direction[0], direction[-1], len(direction))
    return bool(np.abs(direction - steady).max() < EVEN_TURN)


def _is_arc(direction: FloatArray) -> bool:
    """True of directions that turn steadily by at most once round and a quarter."""
    return bool(abs(direction[-1] - direction[0]) <= ONCE_ROUND[1]) and _is_steady(direction)


def _is_circuit(path: RolledOut, begin: int, end: int) -> bool:
    """True of a path that goes round something once, always one way, and comes back to where it began."""
    if end - begin < 8 * path.span:  # a smaller one has no inside
        return False
    direction = path.directions(begin, end)
    round_ = float(direction[-1] - direction[0])
    if not ONCE_ROUND[0] <= abs(round_) <= ONCE_ROUND[1]:
        return False
    forth = np.sign(round_) * direction
    if (np.maximum.accumulate(forth) - forth).max() > EVEN_TURN:
        return False
    places = path.places[begin : end + 1]
    quarter = len(places) // 4
    reach = float(np.median(np.linalg.norm(places[path.span :] - places[: -path.span], axis=1)))
    gaps = (places[:quarter] - places[-1], places[-quarter:] - places[0])
    return min(float(np.linalg.norm(gap, axis=1).min()) for gap in gaps) < reach
