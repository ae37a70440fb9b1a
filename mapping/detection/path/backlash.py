"""Backlash: a machine whose axes follow only when they are pulled records every place behind where the ball is.

The centre that is recorded hangs behind the true one by up to half the play of each axis: on the way up a crest it is
too low, on the way down too high, and along a sweep every place lies too far back. The heights over all crossings tell
the play: beside the crest that fits best, with its place and its width free, they go up later and come down later, and
stay where the axis was left. So do they where a path round a body turns an axis back, though nothing stands there: they
go from one level to another, by all of the play where that axis is normal to the body. Of each play that is tried the
crests are fitted anew: what is seen of them lies too late and too low, and a path over those is turned too late. Its
size is one number, and what is known of it is the likelihood of all crossings and turns. Crests that are steeper on one
side, or of another section, are so in proportion to their heights and end where they end: a section that all crossings
have in common is marginalised.

What the play does along the sweeps is not felt on level ground: there the axes are taken to be alike, and places carry
a doubt as large. Where the crossings do not decide whether there is a play, heights and places carry what it would do
to them, as far as it is probable.

Reference: theory section 6.10.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from mapping import FloatArray, Trace, length_text
from mapping.base import LaidSweep, LaidTrace, SweepHeights
from mapping.detection import Crossing, Detections
from mapping.instrument import Noise

# Half plays that are tried, in standard deviations of a sample: below a fiftieth a hundred crossings of a hundred
# samples tell nothing (1 / sqrt(10^4)); a play of 60 is wider than the crests that such noise lets see
HALF_PLAYS = np.geomspace(0.02, 30.0, 40)
# Beforehand a machine has a play that matters with this probability (as each cause of a wrong model has), and it is
# named if it makes the heights a thousand times more probable than none, and than a play of each crossing's own: what
# is no play of the machine moves them by different amounts
LIKELY_PLAY, LEAST_PLAY_GAIN = 0.1, float(np.log(1e3))
# One that the heights make less than so many times as probable, the root of ten, is barely worth mentioning (Jeffreys)
WORTH_MENTIONING = float(0.5 * np.log(10.0))
# Sections are no parabolas: what all crossings have in common, in shares of their heights, is a line through knots so
# many half-widths apart and as far out, of one of these standard deviations (those of theory equation 5.1, and one for
# sections that are quite another)
KNOT_STEP, KNOT_REACH, SECTION_SDS = 0.125, 1.5, (0.0, 0.01, 0.03, 0.1, 0.3)
KNOTS = np.arange(-KNOT_REACH, KNOT_REACH + 0.5 * KNOT_STEP, KNOT_STEP)
# A crossing is looked at with this many half-widths to either side of its crest, or to the middle between it and the
# next: the axis stays where it was left, which seven half-widths of level on each side tell to 1 / sqrt(7) of what one
# would. In so many bins at most, ten to a half-width: from the middle of one to its edge a crest falls by
# (1 / 20)^2 of its height, a quarter of a hundredth
WINDOW_HALF_WIDTHS, WINDOW_BINS = 8.0, 160
# Of a crossing free are height, place and width of its crest, and offset and slope of the base
WINDOW_FREEDOM = 5
# The crest that fits best beside a play is sought in so many steps of least squares with the slopes of the one that was
# found, on from that of the play before, as far as this share of its sizes. A play of one standard deviation of the
# noise (20 recordings of some 24 crossings) is 0.86 in the mean by that, by six steps the same to 0.002, and 0.69 by
# crests as they were found
CREST_STEPS, MOST_CREST_CHANGE = 2, 0.5
# Turns of an axis that are asked, in so many bins with this many half-widths to either side, a half-width being half of
# the way that the axis stands still on: two dozen of them with 18 bins at rest on either side tell half a play to
# 2 / sqrt(24 * 36) = 0.07 standard deviations of a bin in white noise. A law that was fitted with the play in it has
# its long waves in tones: a play of one standard deviation round a cylinder is worth 1.4 to 3 in the logarithm at each
# turn. The axis is within 60 degrees of the normal
MOST_TURNS, TURN_BINS, TURN_HALF_WIDTHS, ALONG_NORMAL = 24, 48, 4.0, 0.5
# Of a turn free are offset and slope of the base
TURN_FREEDOM = 2
# Crossings that are asked: two hundred of 160 bins tell half a play of 1 / sqrt(200 * 160) = 0.006 standard deviations
# of a sample, less than the least that is tried
MOST_WINDOWS = 200


@dataclass(frozen=True)
class Backlash:
    """The play of a machine's axes: told, or in doubt.

    Args:
        play: from end to end, of each axis, if there is one, m.
        sd: standard deviation of it, m.
        gain: logarithm of how much more probable it is than none.
        one_way: whether all sweeps go one way: then no sweep tells what it does along them.
        lag: what it does to the samples.
    """

    play: float
    sd: float
    gain: float
    one_way: bool
    lag: Lag

    @property
    def told(self) -> bool:
        """True if it is certain enough to be taken off; if not, all of it may be in the heights, or nothing."""
        return self.gain >= LEAST_PLAY_GAIN

    @property
    def probability(self) -> float:
        """That there is one."""
        return float(1.0 / (1.0 + np.exp(-self.gain)))

    @property
    def _left(self) -> float:
        """Standard deviation of what of it is left in the heights, m."""
        return self.sd if self.told else float(np.sqrt(self.probability) * np.hypot(self.play, self.sd))

    def aside(self, height: float, half_width: float) -> float:
        """Standard deviation of the place of a crest that the play leaves, m.

        Along the sweeps it is not felt: half of it. And half of what is left of it moves the flanks: the least squares
        of a step by h at the crest against a shift of its cap, whose slope is 2 H u / w, are 3 h w / (4 H).

        Args:
            height: of the crest, m.
            half_width: of its disturbance, m.
        """
        along = self.play if self.told else self._left
        return float(np.hypot(0.5 * along, 0.5 * self._left * 0.75 * half_width / max(abs(height), 0.5 * self.play)))

    @property
    def height_sd(self) -> float:
        """Standard deviation that it leaves to heights, m: a crest lowers the axis that it meets midway by half of the
        play, and one that it meets where the last crest left it by all of it."""
        return 0.75 * self._left

    def record(self) -> dict[str, Any]:
        """JSON values, SI units."""
        certain = {"taken_off": self.told, "probability": self.probability}
        values = {"play": self.play, "sd": self.sd, "gain": self.gain, "one_way": self.one_way}
        return values | certain | {"sentence": self.sentence()}

    def sentence(self) -> str:
        """What was found and done, for people."""
        way = " All sweeps go one way: sweeps back would tell" if self.one_way else ""
        if not self.told:
            return (
                f"the readings may hang behind the finger, as of axes with a play of {length_text(self.play, 2)} ± "
                f"{length_text(self.sd, 2)} (probability {100.0 * self.probability:.0f} %): the crossings do not "
                f"decide it. Nothing was taken off; heights carry a doubt of {length_text(self.height_sd, 2)} for it, "
                f"and places of what it moves them.{way}"
            ).removesuffix(".")
        return (
            f"the readings hang behind the finger, as of axes with a play of {length_text(self.play, 2)} ± "
            f"{length_text(self.sd, 2)}: rising flanks are too low, falling ones too high. That was taken off; what it "
            f"does along the sweeps is not felt, and places carry a doubt of {length_text(0.5 * self.play, 2)}.{way}"
        ).removesuffix(".")


def backlash(laid: LaidTrace, found: Detections, taken: Backlash | None = None) -> Backlash | None:
    """The play of the axes, by all crossings together; None if they hardly speak for one.

    Args:
        laid: the trace that was searched.
        found: in it.
        taken: what was taken off it already.
    """
    sd, least, lag = found.noise.sd, 0.0, None
    if taken is not None:
        least, lag = taken.play, taken.lag
    # where a play was taken off, what is no higher than it may be what was taken off too much or too little
    profiles = list(_profiles(laid, [c for c in found.crossings if abs(c.height) > least]))
    if not sd > 0.0:
        return None
    halves = sd * HALF_PLAYS
    crests = sum(len(profile.crests) for profile in profiles)
    crossed = [profile for profile in profiles if len(profile.crests)][:: 1 + crests // MOST_WINDOWS]
    windows = [window for profile in crossed for window in profile.opened(found.noise, lag)]
    # the path is reckoned with crests as they were recorded: higher than the play, or the axis would not have moved
    most = 0.5 * float(np.median([abs(window.height) for window in windows])) if windows else np.inf
    possible = halves <= most
    if not possible.any():
        return None
    tried = [0.0, *halves[possible]]
    seen = [shapes for profile in crossed for shapes in profile.seen(tried)]
    turns = [(profile, profile.turns(sd)) for profile in profiles]
    turned = [each for each in turns if len(each[1])][:: 1 + sum(len(at) for _, at in turns) // MOST_TURNS]
    at_turns = [profile.left_at(turns, tried, found.noise, lag) for profile, turns in turned]
    if not windows and not sum(map(len, at_turns)):
        return None
    section = _Section(windows, seen, np.concatenate([np.zeros((0, len(tried))), *at_turns]))
    # what no play explains, as where two crests lie side by side, speaks for none: all is as unsure as it is off
    misfit = section.misfit()
    log = np.full(len(halves), -np.inf)
    log[possible] = section.gains() / misfit
    gain = _evidence(log) - max(0.0, _evidence_of_each(section.gains_of_each() / misfit, len(halves)))
    if gain < np.log(LIKELY_PLAY) + WORTH_MENTIONING:
        return None
    weight = np.exp(log - log.max())
    weight /= weight.sum()
    half = float(weight @ halves)
    # sizes that are tried are a step apart, and one that lies between is as likely anywhere in it
    step = half * (HALF_PLAYS[1] / HALF_PLAYS[0] - 1.0)
    spread = float(np.sqrt(weight @ (halves - half) ** 2 + step**2 / 12.0))
    ways = np.array([_way(sweep.trace) for sweep in laid.laid_sweeps if len(sweep.trace) > 1])
    one_way = bool((ways @ ways[0] > 0.0).all())
    return Backlash(2.0 * half, 2.0 * spread, gain, one_way, _lag(profiles, half))


def without_backlash(trace: Trace, play: Backlash) -> Trace:
    """A trace without what its axes hang behind, by the path under the crests that were found.

    Args:
        trace: the samples (N) to correct; of the same recording as what was searched, under any sweep numbers.
        play: of its axes.
    """
    lag = play.lag.at(trace.t)
    contacts = None if trace.contacts is None else trace.contacts - lag
    return Trace(
        trace.t,
        trace.centers - lag,
        trace.sweep,
        trace.tip_radius,
        trace.normals,
        contacts,
        trace.force,
        trace.resolution,
    )


def with_doubt(found: Detections, play: Backlash) -> Detections:
    """What was detected, its places as doubtful as the play leaves them, and a word on it."""
    crossings = tuple(
        replace(c, position_sd=float(np.hypot(c.position_sd, play.aside(c.height, c.half_width))))
        for c in found.crossings
    )
    return replace(found, crossings=crossings, remarks=(*found.remarks, play.sentence()))


def _evidence(log: FloatArray) -> float:
    """Logarithm of the mean likelihood over the sizes that are tried, against none, with the prior odds."""
    top = float(log.max())
    return top + float(np.log(np.exp(log - top).mean())) + float(np.log(LIKELY_PLAY))


def _evidence_of_each(log: FloatArray, tried: int) -> float:
    """The same if every crossing and turn (W) hangs behind by an amount of its own, by these gains (W, H) of those that
    are possible of so many, or by none: no machine does that."""
    top = np.maximum(log.max(axis=1, initial=0.0), 0.0)
    own = LIKELY_PLAY * np.exp(log - top[:, None]).sum(axis=1) / tried + (1.0 - LIKELY_PLAY) * np.exp(-top)
    return float(np.sum(top + np.log(own)))


def _way(trace: Trace) -> FloatArray:
    way = trace.centers[-1] - trace.centers[0]
    return np.asarray(way / max(float(np.linalg.norm(way)), float(np.finfo(float).tiny)))


@dataclass(frozen=True, eq=False)
class Lag:
    """By how much the axes were off where the ball was.

    Args:
        t: (N,) times, ascending, s.
        behind: (N, 3) m.
    """

    t: FloatArray
    behind: FloatArray

    def at(self, t: FloatArray) -> FloatArray:
        """(M, 3) at times (M,)."""
        return np.column_stack([np.interp(t, self.t, self.behind[:, k]) for k in range(3)])


def _lag(profiles: Sequence[_Profile], half: float) -> Lag:
    t = np.concatenate([profile.heights.t for profile in profiles])
    behind = np.concatenate([profile.behind(half, profile.fitted(half, profile.crests)) for profile in profiles])
    order = np.argsort(t, kind="stable")
    return Lag(t[order], behind[order])


class _Profile:
    """A profile that was searched, the finest one, with what was found in it.

    Args:
        heights: of its bins (n).
        own: its crests and dips (K).
        sweep: that it is of.
    """

    def __init__(self, heights: SweepHeights, own: Sequence[Crossing], sweep: LaidSweep) -> None:
        self.heights, self.s = heights, heights.s
        feet = sweep.feet((heights.first[:-1] + heights.first[1:] - 1) // 2)
        self.normals = np.asarray(feet.normals)
        self._level = feet.points + sweep.trace.tip_radius * feet.normals
        crests = [(c.height, float(np.interp(c.t, heights.t, self.s)), c.half_width) for c in own]
        # (K, 3) height, place and half-width of each, m
        self.crests = np.array(crests).reshape(-1, 3)
        self.windows: dict[int, _Window] = {}

    def opened(self, noise: Noise, taken: Lag | None) -> Iterator[_Window]:
        """A window about each crest that has enough about it."""
        raw = self._beside(taken)
        for which in range(len(self.crests)):
            window = _window(self, which, raw, noise)
            if window is not None:
                self.windows[which] = window
                yield window

    def _beside(self, taken: Lag | None) -> FloatArray:
        """(n,) heights beside all crests, with all of the play, m."""
        raw = self.heights.height - self._own_caps
        if taken is not None:
            raw = raw + np.einsum("ij,ij->i", taken.at(self.heights.t), self.normals)
        return raw

    def turns(self, half: float) -> FloatArray:
        """(T, 2) places where the path over the bare body turns an axis that stands on it, and half-widths of the way
        on which one with half a play stands still there, m."""
        behind, found = self.behind(half, self.crests[:0]), [np.zeros((0, 2))]
        for axis in range(3):
            ends = np.flatnonzero(np.abs(behind[:, axis]) > 0.999 * half)
            turned = np.flatnonzero(np.diff(np.sign(behind[ends, axis])))
            before, after = ends[turned], ends[turned + 1]
            stands = np.abs(self.normals[(before + after) // 2, axis]) > ALONG_NORMAL
            first, last = self.s[before[stands]], self.s[after[stands]]
            found.append(np.column_stack([0.5 * (first + last), 0.5 * (last - first)]))
        return np.concatenate(found)

    def _caps(self, crests: FloatArray) -> FloatArray:
        """(n,) heights of crests (K, 3), m."""
        from mapping.detection.path.backlash_kernels import heights_of_caps

        return np.asarray(heights_of_caps(self.s, crests))

    def behind(self, half: float, crests: FloatArray) -> FloatArray:
        """(n, 3) by how much axes with half a play are off where the ball runs over such crests (K, 3), m."""
        from mapping.detection.path.backlash_kernels import hang_behind

        path = self._level + self._caps(crests)[:, None] * self.normals
        return np.asarray(hang_behind(path, half))

    def _shape(self, half: float, crests: FloatArray) -> FloatArray:
        """(n,) what of the heights is not the crests that were found, with half a play and such crests (K, 3), m."""
        from mapping.detection.path.backlash_kernels import lowered_by

        caps = self._caps(crests)
        return np.asarray(lowered_by(self._level, self.normals, caps, half) + caps - self._own_caps)

    @cached_property
    def _own_caps(self) -> FloatArray:
        return self._caps(self.crests)

    def fitted(self, half: float, crests: FloatArray) -> FloatArray:
        """(K, 3) the crests that fit best beside half a play, from such ones on: what the play does to the heights
        depends on where they turn, and where they seem to turn on what the play does."""
        for _ in range(CREST_STEPS if self.windows else 0):
            shape, crests = self._shape(half, crests), crests.copy()
            for which, window in self.windows.items():
                crests[which] = window.nearer(crests[which], shape)
        return crests

    def seen(self, halves: Sequence[float]) -> list[FloatArray]:
        """What each half play, ascending, makes of the heights in each window, beside crests that fit it best: (H, n)
        of each, whitened."""
        shapes, crests = [], self.crests
        for half in halves:
            crests = self.fitted(half, crests)
            shapes.append(self._shape(half, crests))
        return [np.array([window.seen(shape) for shape in shapes]) for window in self.windows.values()]

    def left_at(self, turns: FloatArray, halves: Sequence[float], noise: Noise, taken: Lag | None) -> FloatArray:
        """(T, H) what half plays leave about turns of an axis (T, 2), squared and summed, in variances of the noise.

        Those too near to an end, to a crest or to each other are left out.
        """
        from mapping.detection.path.backlash_kernels import hang_behind

        spacing = self.heights.spacing
        merge = max(1, round(2.0 * TURN_HALF_WIDTHS * float(np.median(turns[:, 1])) / (TURN_BINS * spacing)))
        place, count = np.sort(turns[:, 0]), TURN_BINS * merge
        first, reach = np.searchsorted(self.s, place) - count // 2, 0.5 * count * spacing
        clear = (first >= 0) & (first + count <= len(self.s)) & (np.diff(place, prepend=-np.inf) >= 2.0 * reach)
        clear &= (np.abs(place[:, None] - self.crests[:, 1]) > reach + self.crests[:, 2]).all(axis=1)
        bins = first[clear, None] + np.arange(count)
        root = _whitening(self.heights, TURN_BINS, merge, noise)
        free = np.linalg.qr(root @ np.column_stack([np.ones(TURN_BINS), np.arange(float(TURN_BINS))]))[0]
        root -= free @ (free.T @ root)
        path, raw = self._level + self._own_caps[:, None] * self.normals, self._beside(taken)
        left = [raw - np.einsum("ij,ij->i", hang_behind(path, half), self.normals) for half in halves]
        means = np.array(left)[:, bins].reshape(len(halves), -1, TURN_BINS, merge).mean(axis=3)
        return np.asarray(((means @ root.T) ** 2).sum(axis=2).T)


def _profiles(laid: LaidTrace, crossings: Sequence[Crossing]) -> Iterator[_Profile]:
    for sweep in laid.laid_sweeps:
        own = [c for c in crossings if c.sweep == sweep.number and not c.is_step]
        for heights in sweep.known_heights():
            if len(heights.t) > 2:
                yield _Profile(heights, [c for c in own if heights.t[0] <= c.t <= heights.t[-1]], sweep)


class _Window:
    """A crossing and what lies beside it.

    Args:
        root: (n, n) whitens its noise and projects out its crest and the base's offset and slope.
        step: (3, n) by how much heights move height, place and half-width of its crest.
        left: (n,) heights beside all crests, with all of the play, m.
        crest: (3,) that was found: height, place and half-width, m.
        u: (n,) places in half-widths.
        inside: the window's bins among the profile's.
        merge: bins of the profile in one of the window.
    """

    def __init__(
        self,
        root: FloatArray,
        step: FloatArray,
        left: FloatArray,
        crest: FloatArray,
        u: FloatArray,
        inside: slice,
        merge: int,
    ) -> None:
        self.root, self.values, self._step, self._left = root, root @ left, step, left
        self._crest, self._u, self._inside, self._merge = crest, u, inside, merge

    @property
    def height(self) -> float:
        """Of its crest, m."""
        return float(self._crest[0])

    def section(self) -> FloatArray:
        """(n, K) the height at its knots, whitened."""
        hats = np.maximum(1.0 - np.abs(self._u[:, None] - KNOTS) / KNOT_STEP, 0.0)
        return np.asarray(self.root @ (self.height * hats))

    def seen(self, shape: FloatArray) -> FloatArray:
        """(n,) of heights of the profile, whitened."""
        return np.asarray(self.root @ _merged(shape[self._inside], self._merge))

    def nearer(self, crest: FloatArray, shape: FloatArray) -> FloatArray:
        """(3,) a crest that fits better than one beside which the heights of the profile are these."""
        better = crest + self._step @ (self._left - _merged(shape[self._inside], self._merge))
        height, _, half_width = self._crest
        # as far as the crest that was found tells anything of it
        far = MOST_CREST_CHANGE * np.array([abs(height), half_width, half_width])
        return np.asarray(np.clip(better, self._crest - far, self._crest + far))


class _Section:
    """What all crossings have in common beside their caps, marginalised.

    Args:
        windows: the crossings (W).
        seen: what is made of their heights (H, n) by no play and by each that is tried.
        at_turns: (T, H) what these leave at turns of an axis, in variances of the noise.
    """

    def __init__(self, windows: Sequence[_Window], seen: Sequence[FloatArray], at_turns: FloatArray) -> None:
        self._at_turns = at_turns
        self._left = [window.values - each for window, each in zip(windows, seen, strict=True)]
        self.columns = [window.section() for window in windows]
        gram = sum((each.T @ each for each in self.columns), start=np.zeros((len(KNOTS), len(KNOTS))))
        unit = np.eye(len(gram))
        # of each standard deviation: covariance of the knots after the heights, and what that costs
        self.after = [sd**2 * np.linalg.inv(unit + sd**2 * gram) for sd in SECTION_SDS]
        self.cost = [-0.5 * float(np.linalg.slogdet(unit + sd**2 * gram)[1]) for sd in SECTION_SDS]
        # (S, H) log-likelihoods
        tried = range(at_turns.shape[1])
        logs = np.array([[self._log_of([each[k] for each in self._left], sd) for k in tried] for sd in self._sds])
        self._logs = logs - 0.5 * at_turns.sum(axis=0)

    @property
    def _sds(self) -> range:
        """Numbers of SECTION_SDS."""
        return range(len(SECTION_SDS))

    def gains(self) -> FloatArray:
        """(H - 1,) gain in the log-likelihood for the half plays."""
        mean = np.logaddexp.reduce(self._logs, axis=0)
        return np.asarray(mean[1:] - mean[0])

    def misfit(self) -> float:
        """Mean square that the play which fits best leaves over, in variances of the noise; at least 1."""
        over = float((-2.0 * (self._logs - np.array(self.cost)[:, None])).min())
        free = sum(each.shape[1] - WINDOW_FREEDOM for each in self._left)
        free += len(self._at_turns) * (TURN_BINS - TURN_FREEDOM)
        return float(max(1.0, over / max(free, 1)))

    def gains_of_each(self) -> FloatArray:
        """(W + T, H - 1) the same of every crossing alone, beside the section that all have without a play, and of
        every turn."""
        none = [each[0] for each in self._left]
        common = self.after[int(np.argmax(self._logs[:, 0]))] @ self._moment(none)
        beside = [left - columns @ common for left, columns in zip(self._left, self.columns, strict=True)]
        square = np.concatenate([*((left**2).sum(axis=1)[None] for left in beside), self._at_turns])
        return np.asarray(0.5 * (square[:, :1] - square[:, 1:]))

    def _moment(self, left: Sequence[FloatArray]) -> FloatArray:
        return sum((each.T @ y for each, y in zip(self.columns, left, strict=True)), start=np.zeros(len(KNOTS)))

    def _log_of(self, left: Sequence[FloatArray], k: int) -> float:
        moment = self._moment(left)
        alone = sum(float(y @ y) for y in left)
        return float(0.5 * (moment @ self.after[k] @ moment - alone) + self.cost[k])


def _merged(values: FloatArray, merge: int) -> FloatArray:
    return np.asarray(values[: len(values) // merge * merge].reshape(-1, merge).mean(axis=1))


def _window(profile: _Profile, which: int, left: FloatArray, noise: Noise) -> _Window | None:
    """The window about a crest of a profile, by heights (N,) beside all crests; None if too little lies about it, or it
    is cut off by the end of the sweep."""
    s, crest = profile.s, profile.crests[which]
    height, place, half_width = crest
    if place - half_width < s[0] or place + half_width > s[-1]:
        return None  # one flank alone: what it lacks of a crest is no play
    others = [at for at in profile.crests[:, 1] if at != place]
    low = max([place - WINDOW_HALF_WIDTHS * half_width, *(0.5 * (at + place) for at in others if at < place)])
    high = min([place + WINDOW_HALF_WIDTHS * half_width, *(0.5 * (at + place) for at in others if at > place)])
    first, last = np.searchsorted(s, [low, high])
    merge = max(1, int(last - first) // WINDOW_BINS)
    count = int(last - first) // merge
    if count < 8:
        return None
    inside = slice(int(first), int(first) + count * merge)
    u = (_merged(s[inside], merge) - place) / half_width
    under = (np.abs(u) < 1.0).astype(np.float64)
    root = _whitening(profile.heights, count, merge, noise)
    # height, place and half-width of the crest, and what the base may be off by
    slope = 2.0 * height * under / half_width
    free = np.column_stack([np.maximum(1.0 - u**2, 0.0), slope * u, slope * u**2, np.ones(count), u])
    basis, triangle = np.linalg.qr(root @ free)
    if not np.abs(np.diag(triangle)).min() > 1e-12 * np.abs(triangle).max():
        return None  # a crest between two bins
    step = np.linalg.solve(triangle, basis.T @ root)[:3]
    return _Window(root - basis @ (basis.T @ root), step, _merged(left[inside], merge), crest, u, inside, merge)


def _whitening(heights: SweepHeights, count: int, merge: int, noise: Noise) -> FloatArray:
    """(count, count) inverse root of the covariance of so many blocks of a profile's bins."""
    filter_ = noise.block_filter(count, merge * heights.spacing, heights.samples * merge)
    return np.ascontiguousarray(filter_.whiten(np.eye(count)).T)
