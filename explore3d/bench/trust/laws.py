"""Laws of error: what real instruments add to what they feel, each as a function of the path and a level.

Every law takes samples of a path that is free of error and returns which of them were recorded, and where they were
recorded. Its level is a standard deviation of single samples unless its sentence says otherwise.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mapping import FloatArray, IntArray

# Samples a second are this speed, m/s, over their distance: tones and drifts are laws of time
FINGER_SPEED = 0.03


@dataclass(frozen=True, eq=False)
class Path:
    """A finger's path without error.

    Args:
        centers: (N, 3) of the ball, m.
        normals: (N, 3) of the base there.
        sweep: (N,) number of each sample's sweep, ascending.
        spacing: usual distance of the samples, m.
        tip_radius: m.
    """

    centers: FloatArray
    normals: FloatArray
    sweep: IntArray
    spacing: float
    tip_radius: float

    @property
    def parts(self) -> list[slice]:
        """The samples of each sweep."""
        edges = np.flatnonzero(np.diff(self.sweep, prepend=-1, append=self.sweep[-1] + 1))
        return [slice(int(a), int(b)) for a, b in itertools.pairwise(edges)]

    @property
    def t(self) -> FloatArray:
        """(N,) times, s; a quarter of a second passes between sweeps."""
        return np.arange(float(len(self.sweep))) * self.spacing / FINGER_SPEED + 0.25 * self.sweep


@dataclass(frozen=True)
class Level:
    """How much of a law there is.

    Args:
        sd: m.
        length: over which errors are shared, m.
    """

    sd: float
    length: float


# (M,) which samples were recorded, and (M, 3) their centres as recorded, m
Recorded = tuple[IntArray, FloatArray]


@dataclass(frozen=True)
class Law:
    """One law.

    Args:
        sentence: what it is, in units of the level.
        record: the samples as they are recorded.
    """

    sentence: str
    record: Callable[[Path, Level, np.random.Generator], Recorded]


def _heights(errors: Callable[[Path, Level, np.random.Generator], FloatArray]) -> Callable[..., Recorded]:
    """The law of heights (N,) along the normals."""

    def record(path: Path, level: Level, rng: np.random.Generator) -> Recorded:
        return np.arange(len(path.sweep)), path.centers + errors(path, level, rng)[:, None] * path.normals

    return record


def white(path: Path, level: Level, rng: np.random.Generator) -> FloatArray:
    """(N,) white noise of the level, m."""
    return level.sd * rng.standard_normal(len(path.sweep))


def shared(path: Path, length: float, rng: np.random.Generator) -> FloatArray:
    """(N,) Ornstein-Uhlenbeck noise of unit variance over a length, m, anew on each sweep."""
    from scipy.signal import lfilter

    keep = float(np.exp(-path.spacing / length))
    kicks = np.sqrt(1.0 - keep**2) * rng.standard_normal(len(path.sweep))
    for part in path.parts:
        kicks[part.start] /= np.sqrt(1.0 - keep**2)
    return np.concatenate([lfilter([1.0], [1.0, -keep], kicks[part]) for part in path.parts])


def _ou(path: Path, level: Level, rng: np.random.Generator) -> FloatArray:
    return 0.5 * white(path, level, rng) + level.sd * shared(path, level.length, rng)


def _two_ou(path: Path, level: Level, rng: np.random.Generator) -> FloatArray:
    near, far = (shared(path, factor * level.length, rng) for factor in (0.3, 3.0))
    return 0.5 * white(path, level, rng) + level.sd * (0.5 * near + 0.7 * far)


def _colour(exponent: float) -> Callable[[Path, Level, np.random.Generator], FloatArray]:
    """Noise in time whose power goes with 1 / frequency^exponent down to one turn in the whole recording."""

    def errors(path: Path, level: Level, rng: np.random.Generator) -> FloatArray:
        count = len(path.sweep)
        spectrum = np.fft.rfft(rng.standard_normal(count))
        spectrum *= np.concatenate([[0.0], np.arange(1.0, len(spectrum)) ** (-0.5 * exponent)])
        noise = np.fft.irfft(spectrum, count)
        return np.asarray(level.sd * noise / noise.std())

    return errors


def _by_sweep(path: Path, rng: np.random.Generator) -> FloatArray:
    """(N,) factor of each sweep, log-normal 0.5."""
    factors = np.exp(0.5 * rng.standard_normal(len(path.parts)))
    return np.concatenate([np.full(p.stop - p.start, f) for p, f in zip(path.parts, factors, strict=True)])


def _along(path: Path, rng: np.random.Generator) -> FloatArray:
    """(N,) factor that goes from 1/2 to 2 and back along the sweeps."""
    turns = np.arange(len(path.sweep)) * path.spacing / rng.uniform(20.0, 40.0) / path.tip_radius
    return np.asarray(2.0 ** np.sin(2 * np.pi * (turns + rng.random())))


def _level_by_sweep(path: Path, level: Level, rng: np.random.Generator) -> FloatArray:
    return white(path, level, rng) * _by_sweep(path, rng)


def _level_along(path: Path, level: Level, rng: np.random.Generator) -> FloatArray:
    return white(path, level, rng) * _along(path, rng)


def _mixed(path: Path, level: Level, rng: np.random.Generator) -> FloatArray:
    return _ou(path, level, rng) * _by_sweep(path, rng) * _along(path, rng)


def _tones(path: Path, level: Level, rng: np.random.Generator) -> FloatArray:
    tones = [np.sin(2 * np.pi * (hertz * path.t + rng.random())) for hertz in (8.0, 50.0)]
    return np.asarray(white(path, level, rng) + 0.5 * level.sd * np.sum(tones, axis=0))


def _resonance(path: Path, level: Level, rng: np.random.Generator) -> FloatArray:
    """White noise, and as much of it rung by a beam of 60 Hz and quality 15."""
    from scipy.signal import lfilter

    turn = 2 * np.pi * 60.0 * path.spacing / FINGER_SPEED
    keep = np.exp(-turn / 30.0)
    rung = lfilter([1.0], [1.0, -2 * keep * np.cos(turn), keep**2], rng.standard_normal(len(path.sweep)))
    return np.asarray(white(path, level, rng) + level.sd * rung / rung.std())


def _student(path: Path, level: Level, rng: np.random.Generator) -> FloatArray:
    return np.asarray(level.sd * rng.standard_t(3, len(path.sweep)) / np.sqrt(3.0))


def _spikes(path: Path, level: Level, rng: np.random.Generator) -> FloatArray:
    height = white(path, level, rng)
    hit = rng.random(len(height)) < 1e-3
    height[hit] += 20.0 * level.sd * rng.standard_normal(int(hit.sum()))
    return height


def _bursts(path: Path, level: Level, rng: np.random.Generator) -> FloatArray:
    """Runs of 10 to 40 samples, two a metre, 10 to 30 levels off."""
    height = white(path, level, rng)
    for begin in rng.integers(0, len(height) - 40, int(2.0 * len(height) * path.spacing)):
        height[begin : begin + rng.integers(10, 40)] += level.sd * rng.uniform(10, 30) * rng.choice([-1.0, 1.0])
    return height


def _stuck(path: Path, level: Level, rng: np.random.Generator) -> FloatArray:
    """Runs of 10 to 60 samples, three a metre, in which the height does not change."""
    height = white(path, level, rng)
    for begin in rng.integers(0, len(height) - 60, int(3.0 * len(height) * path.spacing)):
        height[begin : begin + rng.integers(10, 60)] = height[begin]
    return height


def _linear_drift(path: Path, level: Level, rng: np.random.Generator) -> FloatArray:
    # also while the finger is on its way from sweep to sweep: by the samples' count it would be a tilt of a plate
    far = 20.0 * level.sd * rng.choice([-1.0, 1.0])
    return np.asarray(white(path, level, rng) + far * path.t / path.t[-1])


def _random_walk(path: Path, level: Level, rng: np.random.Generator) -> FloatArray:
    """A walk that comes two levels far over the length of a sweep of forty tips."""
    steps = 2.0 * level.sd * np.sqrt(path.spacing / (40.0 * path.tip_radius))
    return np.asarray(white(path, level, rng) + steps * np.cumsum(rng.standard_normal(len(path.sweep))))


def _lines(path: Path, level: Level, rng: np.random.Generator) -> FloatArray:
    own = [
        rng.normal(0.0, 3.0) + rng.normal(0.0, 3.0) * np.linspace(-1.0, 1.0, part.stop - part.start)
        for part in path.parts
    ]
    return white(path, level, rng) + level.sd * np.concatenate(own)


def _backlash(path: Path, level: Level, rng: np.random.Generator) -> Recorded:
    """Each axis of the machine follows when it is pulled: it hangs behind by up to half its play, one level."""
    from explore3d.bench.trust.play_kernels import play

    centers = play(path.centers, path.sweep, 0.5 * level.sd)
    return np.arange(len(path.sweep)), centers + white(path, level, rng)[:, None] * path.normals


def _stick_slip(path: Path, level: Level, rng: np.random.Generator) -> Recorded:
    """The finger holds, and slips on by some four samples at once; it is recorded all the while."""
    index = np.arange(len(path.sweep))
    for part in path.parts:
        count = part.stop - part.start
        slips = np.unique(np.concatenate([[0], np.cumsum(rng.integers(2, 7, count // 2)), [count]]).clip(0, count))
        index[part] = part.start + np.repeat(slips[:-1], np.diff(slips))
    noise = level.sd * rng.standard_normal(len(index))
    return index, path.centers[index] + noise[:, None] * path.normals[index]


def _encoder(share: float) -> Callable[[Path, Level, np.random.Generator], Recorded]:
    """White noise, and every coordinate in steps of a share of it."""

    def record(path: Path, level: Level, rng: np.random.Generator) -> Recorded:
        centers = path.centers + white(path, level, rng)[:, None] * path.normals
        step = share * level.sd
        return np.arange(len(centers)), step * np.round(centers / step)

    return record


def _gaps(path: Path, level: Level, rng: np.random.Generator) -> Recorded:
    """Three gaps a metre of half a tip to two tips, nothing recorded."""
    kept = np.ones(len(path.sweep), dtype=bool)
    for begin in rng.integers(0, len(kept), int(3.0 * len(kept) * path.spacing)):
        kept[begin : begin + int(rng.uniform(0.5, 2.0) * path.tip_radius / path.spacing)] = False
    index = np.flatnonzero(kept)
    return index, (path.centers + white(path, level, rng)[:, None] * path.normals)[index]


def _rates(path: Path, level: Level, rng: np.random.Generator) -> Recorded:
    """Of every other sweep one sample in five."""
    kept = (path.sweep % 2 == 0) | (np.arange(len(path.sweep)) % 5 == 0)
    index = np.flatnonzero(kept)
    return index, (path.centers + white(path, level, rng)[:, None] * path.normals)[index]


def _speed(path: Path, level: Level, rng: np.random.Generator) -> Recorded:
    """A tip that speeds up to four times its first speed amid each sweep, and slows down again."""
    kept = np.zeros(len(path.sweep), dtype=bool)
    for part in path.parts:
        share = np.linspace(0.0, 1.0, part.stop - part.start)
        ticks = np.floor(np.cumsum(1.0 / (1.0 + 3.0 * np.sin(np.pi * share) ** 2)))
        kept[part] = np.diff(ticks, prepend=-1.0) > 0
    index = np.flatnonzero(kept)
    return index, (path.centers + white(path, level, rng)[:, None] * path.normals)[index]


def _by_chance(path: Path, level: Level, rng: np.random.Generator) -> Recorded:
    """One sample in three, which one chance decides."""
    index = np.flatnonzero(rng.random(len(path.sweep)) < 1.0 / 3.0)
    return index, (path.centers + white(path, level, rng)[:, None] * path.normals)[index]


def _rough(path: Path, level: Level, rng: np.random.Generator) -> FloatArray:
    """White noise, and a trace whose own height varies by half of it (Rq), smooth over the length."""
    from scipy.ndimage import gaussian_filter1d

    rough = gaussian_filter1d(rng.standard_normal(len(path.sweep)), level.length / path.spacing)
    return np.asarray(white(path, level, rng) + 0.5 * level.sd * rough / rough.std())


LAWS: dict[str, Law] = {
    "white": Law("white noise", _heights(white)),
    "ou": Law("Ornstein-Uhlenbeck noise and half as much white noise", _heights(_ou)),
    "1/f^0.5": Law("power by 1/f^0.5 over the recording", _heights(_colour(0.5))),
    "1/f": Law("power by 1/f over the recording", _heights(_colour(1.0))),
    "1/f^1.5": Law("power by 1/f^1.5 over the recording", _heights(_colour(1.5))),
    "two ou": Law("two Ornstein-Uhlenbeck parts, lengths 1:10, and white noise", _heights(_two_ou)),
    "level by sweep": Law("white, its level log-normal 0.5 by sweep", _heights(_level_by_sweep)),
    "level along": Law("white, its level changing by a factor of 4 along the sweeps", _heights(_level_along)),
    "mixed levels": Law("Ornstein-Uhlenbeck and white, level by sweep and along", _heights(_mixed)),
    "tones": Law("white, tones of 8 and 50 Hz of half a level", _heights(_tones)),
    "resonance": Law("white, and as much rung by a beam of 60 Hz, quality 15", _heights(_resonance)),
    "student": Law("Student's t of 3 degrees of freedom", _heights(_student)),
    "spikes": Law("white, one sample in a thousand 20 levels off", _heights(_spikes)),
    "bursts": Law("white, two runs a metre of 10 to 40 samples 10 to 30 levels off", _heights(_bursts)),
    "stuck": Law("white, three runs a metre of 10 to 60 samples at one height", _heights(_stuck)),
    "linear drift": Law("white, a drift of 20 levels over the recording", _heights(_linear_drift)),
    "random walk": Law("white, a random walk of 2 levels over forty tip radii", _heights(_random_walk)),
    "lines": Law("white, each sweep its own offset and slope of 3 levels", _heights(_lines)),
    "backlash": Law("white, each machine axis with a play of one level", _backlash),
    "stick-slip": Law("white, the finger held and let go on every four samples", _stick_slip),
    "encoder 0.5": Law("white, coordinates in steps of half a level", _encoder(0.5)),
    "encoder 1": Law("white, coordinates in steps of one level", _encoder(1.0)),
    "gaps": Law("white, three gaps a metre of half a tip radius to two", _gaps),
    "rates": Law("white, every other sweep sampled a fifth as densely", _rates),
    "roughness": Law("white, a smooth roughness of Rq half a level", _heights(_rough)),
    "speed": Law("white, four times as fast amid each sweep as at its ends", _speed),
    "by chance": Law("white, every third sample on average, by chance", _by_chance),
}
