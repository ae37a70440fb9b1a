"""Backlash: a machine whose axes follow only when they are pulled records every place behind where the ball is.

The centre that is recorded hangs behind the true one by up to half the play of each axis: on the way up a crest it is
too low, on the way down too high, and along a sweep every place lies too far back. The heights over all crossings tell
the play: beside the crest that fits best, with its place and its width free, they go up later and come down later, and
stay where the axis was left. Its size is one number, and what is known of it is the likelihood of all crossings. Crests
that are steeper on one side, or of another section, are so in proportion to their heights and end where they end: a
section that all crossings have in common is marginalised.

What the play does along the sweeps is not felt on level ground: there the axes are taken to be alike, and places carry
a doubt as large. Where the crossings do not decide whether there is a play, heights and places carry what it would do
to them, as far as it is probable.

Reference: theory section 6.10.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
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
# A crossing is looked at with this many half-widths to either side of its crest, or to the middle between it and the
# next: the axis stays where it was left, which seven half-widths of level on each side tell to 1 / sqrt(7) of what one
# would. In so many bins at most, ten to a half-width: from the middle of one to its edge a crest falls by
# (1 / 20)^2 of its height, a quarter of a hundredth
WINDOW_HALF_WIDTHS, WINDOW_BINS = 8.0, 160
# Of a crossing free are height, place and width of its crest, and offset and slope of the base
WINDOW_FREEDOM = 5
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
    """

    play: float
    sd: float
    gain: float
    one_way: bool

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
        return asdict(self) | certain | {"sentence": self.sentence()}

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


def backlash(laid: LaidTrace, found: Detections, taken: float = 0.0) -> Backlash | None:
    """The play of the axes, by all crossings together; None if they hardly speak for one.

    Args:
        laid: the trace that was searched.
        found: in it.
        taken: play that was taken off it already, m.
    """
    sd = found.noise.sd
    profiles = _profiles(laid, found.crossings)
    windows = [window for profile in profiles for window in _windows(profile, found.noise)]
    windows = windows[:: 1 + len(windows) // MOST_WINDOWS]
    if not windows or not sd > 0.0:
        return None
    halves = sd * HALF_PLAYS
    section = _Section(windows, halves, 0.5 * taken)
    # what no play explains, as where two crests lie side by side, speaks for none: all is as unsure as it is off
    misfit = section.misfit()
    log = section.gains() / misfit
    # the path is reckoned with crests as they were recorded: higher than the play, or the axis would not have moved
    log[halves > 0.5 * float(np.median([abs(window.height) for window in windows]))] = -np.inf
    gain = _evidence(log) - max(0.0, _evidence_of_each(section.gains_of_each() / misfit))
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
    return Backlash(2.0 * half, 2.0 * spread, gain, one_way)


def without_backlash(trace: Trace, laid: LaidTrace, found: Detections, play: float) -> Trace:
    """A trace without what its axes hang behind, by the path under the crests that were found.

    Args:
        trace: the samples (N) to correct; of the same recording as what was searched, under any sweep numbers.
        laid, found: as given to `backlash`.
        play: of each axis, m.
    """
    from mapping.detection.path.backlash_kernels import hang_behind

    when, behind = [np.zeros(0)], [np.zeros((0, 3))]
    for profile in _profiles(laid, found.crossings):
        when.append(profile.heights.t)
        behind.append(hang_behind(profile.path, 0.5 * play))
    t, off = np.concatenate(when), np.concatenate(behind)
    order = np.argsort(t, kind="stable")
    lag = np.column_stack([np.interp(trace.t, t[order], off[order, k]) for k in range(3)])
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


def _evidence_of_each(log: FloatArray) -> float:
    """The same if every crossing (K) hangs behind by an amount of its own (K, H), or by none: no machine does that."""
    top = np.maximum(log.max(axis=1), 0.0)
    own = LIKELY_PLAY * np.exp(log - top[:, None]).mean(axis=1) + (1.0 - LIKELY_PLAY) * np.exp(-top)
    return float((top + np.log(own)).sum())


def _way(trace: Trace) -> FloatArray:
    way = trace.centers[-1] - trace.centers[0]
    return np.asarray(way / max(float(np.linalg.norm(way)), float(np.finfo(float).tiny)))


class _Profile:
    """A profile that was searched, the finest one, with what was found in it.

    Args:
        heights: of its bins (n).
        own: its crests and dips.
        path: (n, 3) where the ball's centre goes over the base and these, without noise, m.
        normals: (n, 3) of the base under it.
    """

    def __init__(self, heights: SweepHeights, own: Sequence[Crossing], sweep: LaidSweep) -> None:
        self.heights, self.own, self.s = heights, own, heights.s
        self.places = [float(np.interp(c.t, heights.t, self.s)) for c in own]
        feet = sweep.feet((heights.first[:-1] + heights.first[1:] - 1) // 2)
        self.normals = np.asarray(feet.normals)
        self.path = np.asarray(feet.points + (sweep.trace.tip_radius + self.caps())[:, None] * feet.normals)

    def caps(self) -> FloatArray:
        """(n,) heights of all that was found, m."""
        pairs = zip(self.own, self.places, strict=True)
        return sum((_cap(self.s, place, c) for c, place in pairs), np.zeros(len(self.s)))


def _profiles(laid: LaidTrace, crossings: Sequence[Crossing]) -> Iterator[_Profile]:
    for sweep in laid.laid_sweeps:
        own = [c for c in crossings if c.sweep == sweep.number and not c.is_step]
        for heights in sweep.known_heights():
            if len(heights.t) > 2:
                yield _Profile(heights, [c for c in own if heights.t[0] <= c.t <= heights.t[-1]], sweep)


def _cap(s: FloatArray, place: float, crossing: Crossing) -> FloatArray:
    u = (s - place) / crossing.half_width
    return np.asarray(crossing.height * np.maximum(1.0 - u**2, 0.0))


class _Window:
    """A crossing and what lies beside it.

    Args:
        root: (n, n) whitens its noise and projects out its crest and the base's offset and slope.
        values: (n,) heights beside all crests, whitened.
        height: of its crest, m.
        u: (n,) places in half-widths.
        path, normals: (N, 3) of the whole profile.
        inside: the window's bins among the profile's.
        merge: bins of the profile in one of the window.
    """

    def __init__(
        self,
        root: FloatArray,
        values: FloatArray,
        crossing: Crossing,
        u: FloatArray,
        lifted: _Lifted,
        inside: slice,
        merge: int,
    ) -> None:
        self.root, self.values, self.height, self.u = root, values, crossing.height, u
        self.lifted, self.inside, self.merge = lifted, inside, merge

    def section(self) -> FloatArray:
        """(n, K) the height at its knots, whitened."""
        knots = np.arange(-KNOT_REACH, KNOT_REACH + 0.5 * KNOT_STEP, KNOT_STEP)
        hats = np.maximum(1.0 - np.abs(self.u[:, None] - knots) / KNOT_STEP, 0.0)
        return np.asarray(self.root @ (self.height * hats))

    def seen(self, half: float) -> FloatArray:
        """(n,) what a half play makes of the heights, whitened."""
        return np.asarray(self.root @ _merged(self.lifted.by(half)[self.inside], self.merge))


class _Section:
    """What all crossings have in common beside their caps, marginalised.

    Args:
        windows: the crossings (W).
        halves: (H,) half plays that are tried, m.
        taken: half of a play that was taken off their heights already, m.
    """

    def __init__(self, windows: Sequence[_Window], halves: FloatArray, taken: float) -> None:
        self.seen = [np.array([window.seen(half) for half in halves]) for window in windows]
        self.heights = [window.values + window.seen(taken) for window in windows]
        self.columns = [window.section() for window in windows]
        gram = np.sum([each.T @ each for each in self.columns], axis=0)
        unit = np.eye(len(gram))
        # of each standard deviation: covariance of the knots after the heights, and what that costs
        self.after = [sd**2 * np.linalg.inv(unit + sd**2 * gram) for sd in SECTION_SDS]
        self.cost = [-0.5 * float(np.linalg.slogdet(unit + sd**2 * gram)[1]) for sd in SECTION_SDS]

    @property
    def _sds(self) -> range:
        """Numbers of SECTION_SDS."""
        return range(len(SECTION_SDS))

    def gains(self) -> FloatArray:
        """(H,) gain in the log-likelihood for the half plays."""
        tried = range(len(self.seen[0]))
        left = ([y - seen[k] for y, seen in zip(self.heights, self.seen, strict=True)] for k in tried)
        return np.array([self._log(each) for each in left]) - self._log(self.heights)

    def misfit(self) -> float:
        """Mean square that the play which fits best leaves over, in variances of the noise; at least 1."""
        tried = range(len(self.seen[0]))
        left = [[y - seen[k] for y, seen in zip(self.heights, self.seen, strict=True)] for k in tried]
        over = [-2.0 * (self._log_of(each, k) - self.cost[k]) for each in (*left, self.heights) for k in self._sds]
        free = sum(len(y) - WINDOW_FREEDOM for y in self.heights)
        return max(1.0, min(over) / max(free, 1))

    def gains_of_each(self) -> FloatArray:
        """(W, H) the same of every crossing alone, beside the section that all have without a play."""
        logs = [self._log_of(self.heights, k) for k in self._sds]
        common = self.after[int(np.argmax(logs))] @ self._moment(self.heights)
        each = zip(self.seen, self.heights, self.columns, strict=True)
        return np.array([seen @ (y - columns @ common) - 0.5 * (seen**2).sum(axis=1) for seen, y, columns in each])

    def _moment(self, left: Sequence[FloatArray]) -> FloatArray:
        return np.asarray(np.sum([each.T @ y for each, y in zip(self.columns, left, strict=True)], axis=0))

    def _log(self, left: Sequence[FloatArray]) -> float:
        logs = np.array([self._log_of(left, k) for k in self._sds])
        return float(logs.max() + np.log(np.exp(logs - logs.max()).mean()))

    def _log_of(self, left: Sequence[FloatArray], k: int) -> float:
        moment = self._moment(left)
        return float(0.5 * moment @ self.after[k] @ moment) + self.cost[k] - 0.5 * sum(float(y @ y) for y in left)


class _Lifted:
    """By how much the heights of a profile are off under any play; each is computed once."""

    def __init__(self, path: FloatArray, normals: FloatArray) -> None:
        self._path, self._normals = path, normals
        self._known: dict[float, FloatArray] = {}

    def by(self, half: float) -> FloatArray:
        """(N,) for a half play, m."""
        from mapping.detection.path.backlash_kernels import hang_behind

        if half not in self._known:
            self._known[half] = np.einsum("ij,ij->i", hang_behind(self._path, half), self._normals)
        return self._known[half]


def _merged(values: FloatArray, merge: int) -> FloatArray:
    return np.asarray(values[: len(values) // merge * merge].reshape(-1, merge).mean(axis=1))


def _windows(profile: _Profile, noise: Noise) -> Iterator[_Window]:
    s, heights = profile.s, profile.heights
    lifted, left = _Lifted(profile.path, profile.normals), heights.height - profile.caps()
    for crossing, place in zip(profile.own, profile.places, strict=True):
        reach, others = WINDOW_HALF_WIDTHS * crossing.half_width, [at for at in profile.places if at != place]
        low = max([place - reach, *(0.5 * (at + place) for at in others if at < place)])
        high = min([place + reach, *(0.5 * (at + place) for at in others if at > place)])
        first, last = np.searchsorted(s, [low, high])
        merge = max(1, int(last - first) // WINDOW_BINS)
        count = int(last - first) // merge
        if count < 8:
            continue
        inside = slice(int(first), int(first) + count * merge)
        values, x = _merged(left[inside], merge), _merged(s[inside], merge)
        u = (x - place) / crossing.half_width
        bump = np.maximum(1.0 - u**2, 0.0)
        under = (np.abs(u) < 1.0).astype(np.float64)
        covariances = noise.block_covariances(count, merge * heights.spacing, heights.samples * merge)
        lags = np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
        root = np.linalg.inv(np.linalg.cholesky(covariances[lags] + 1e-12 * covariances[0] * np.eye(count)))
        # height, place and width of the crest, and what the base may be off by
        free = root @ np.column_stack([bump, under * u, under * u**2, np.ones(count), u])
        basis = np.linalg.qr(free)[0]
        root = root - basis @ (basis.T @ root)
        yield _Window(root, root @ values, crossing, u, lifted, inside, merge)
