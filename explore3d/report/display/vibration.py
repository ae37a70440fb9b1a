"""Vibration: what a fingertip that crosses a model at a constant speed feels as a signal in time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from explore3d import UserError, count_text
from mapping import FloatArray, ObjectModel, length_text
from mapping.geometry.mesh import arclengths
from mapping.geometry.proxy import ProxyBody, pressed_along
from mapping.model import touchable

# m; the ball is pressed so little that it is beside its place by less than a sample of audio at 1 mm/s
PRESSING = 1e-8
# Samples of 48 kHz audio, and at most as many of one file: ten minutes
AUDIO_RATE, MOST_AUDIO_SAMPLES = 48_000, 48_000 * 600
# A kink is a place where the slope jumps by more than noise of rounding: people feel edges from 1e-3 on
LEAST_KINK = 1e-3
# Kinks closer together than this are one event for a person, s (temporal acuity of touch)
EVENT_GAP = 5e-3
# Human thresholds of vibration at the fingertip, m (peak), over Hz: flat below 40 Hz, falling by 12 dB an octave to
# the best frequency of the Pacinian channel, then rising by as much (Verrillo 1963; Bolanowski et al. 1988)
FLAT_THRESHOLD, FLAT_BELOW, BEST_FREQUENCY = 8e-6, 40.0, 250.0


@dataclass(frozen=True, eq=False)
class Vibration:
    """A crossing in time.

    Args:
        rate: samples per second.
        height: (N,) height of the ball over the base's own trace, m.
        events: (E,) times of the kinks, s; sizes (E,) of the jumps of the slope there.
        speed: m/s.
    """

    rate: float
    height: FloatArray
    events: FloatArray
    sizes: FloatArray
    speed: float

    @property
    def duration(self) -> float:
        """s."""
        return len(self.height) / self.rate

    @property
    def amplitude(self) -> float:
        """Half the span of the heights, m."""
        return 0.5 * float(np.ptp(self.height))

    def spectrum(self) -> tuple[FloatArray, FloatArray]:
        """Frequencies, Hz, and (F,) amplitudes of the heights' discrete Fourier transform, m s."""
        heights = self.height - 0.5 * (self.height[0] + self.height[-1])
        frequency = np.asarray(np.fft.rfftfreq(len(heights), 1.0 / self.rate), dtype=np.float64)
        return frequency, np.abs(np.fft.rfft(heights)) / self.rate

    def band(self, share: float = 0.9) -> tuple[float, float]:
        """Frequencies, Hz, between which that share of the velocity's energy lies: what skin and actuators follow."""
        if self.amplitude <= PRESSING:
            return 0.0, 0.0
        frequency, size = self.spectrum()
        energy = np.cumsum((frequency * size) ** 2)
        low, high = np.searchsorted(energy / energy[-1], [0.5 * (1.0 - share), 0.5 * (1.0 + share)])
        return float(frequency[low]), float(frequency[min(high, len(frequency) - 1)])

    def above_threshold(self) -> float:
        """Largest amplitude over a person's threshold at its frequency, in third-octave bands; above 1 it is felt."""
        heights = self.height - np.linspace(self.height[0], self.height[-1], len(self.height))
        transform = np.fft.rfft(heights)
        frequency = np.fft.rfftfreq(len(heights), 1.0 / self.rate)
        best, low = 0.0, 5.0
        while low < min(1000.0, 0.4 * self.rate):
            high = low * 2.0 ** (1.0 / 3.0)
            inside = np.where((frequency >= low) & (frequency < high), transform, 0.0)
            peak = float(np.abs(np.fft.irfft(inside, len(heights))).max())
            best = max(best, peak / float(human_threshold(np.array([np.sqrt(low * high)]))[0]))
            low = high
        return best

    def lines(self) -> list[str]:
        """What the terminal is told."""
        if self.amplitude <= PRESSING:
            return [
                f"{self.duration:.3g} s, {len(self.height):,} samples at {self.rate:g} Hz",
                "the path crosses no feature, and the fingertip feels nothing; features.csv says where they are",
            ]
        low, high = self.band()
        most = self.above_threshold()
        felt = f"{most:.3g} times" if most >= 1.0 else f"only {most:.2g} times"
        return [
            f"{self.duration:.3g} s, {len(self.height):,} samples at {self.rate:g} Hz, "
            f"{count_text(len(self.events), 'event')}",
            f"amplitude {length_text(self.amplitude)}, 90 % of the velocity's energy from {low:.3g} to {high:.3g} Hz",
            f"at its strongest third of an octave it is {felt} what people feel "
            f"({length_text(float(human_threshold(np.array([BEST_FREQUENCY]))[0]), 2)} at {BEST_FREQUENCY:g} Hz)",
        ]


def human_threshold(frequency: FloatArray) -> FloatArray:
    """Smallest amplitude (peak, m) of a sinusoid (Hz) that the fingertip feels."""
    f = np.maximum(np.asarray(frequency, dtype=np.float64), FLAT_BELOW)
    falling = (FLAT_BELOW / np.minimum(f, BEST_FREQUENCY)) ** 2
    rising = (np.maximum(f, BEST_FREQUENCY) / BEST_FREQUENCY) ** 2
    return np.asarray(FLAT_THRESHOLD * falling * rising)


def vibration(
    model: ObjectModel,
    path: FloatArray,
    speed: float,
    *,
    tip_radius: float | None = None,
    exaggeration: float = 1.0,
    rate: float = AUDIO_RATE,
) -> Vibration:
    """The heights of a ball that crosses a model along a path over its base.

    Args:
        model: what is crossed.
        path: (K, 3) corners near the base, m, K >= 2; the ball runs over the base's nearest points.
        speed: along the path, m/s.
        tip_radius: of the ball, m; None: the one that explored the model.
        exaggeration: of the features' sections, 1 to 100.
        rate: samples per second.

    Raises:
        UserError: a path without length or too long, a speed that is not positive, no tip radius known.
    """
    if not (np.isfinite(speed) and speed > 0.0):
        raise UserError(f"--speed: should be greater than 0; found {speed:g} m/s")
    radius = tip_radius if tip_radius is not None else model.provenance.get("tip_radius")
    if radius is None:
        raise UserError('the model does not say which tip explored it; give one with --tip-radius, for example "5 mm"')
    s = arclengths(path)
    if len(path) < 2 or not s[-1] > 0.0:
        raise UserError("--path: needs at least two places apart from each other")
    count = int(s[-1] / speed * rate) + 1
    if not 16 <= count <= MOST_AUDIO_SAMPLES:
        raise UserError(
            f"--path and --speed: {s[-1]:g} m at {speed:g} m/s are {count} samples at {rate:g} Hz; "
            f"possible: 16 to {MOST_AUDIO_SAMPLES}"
        )
    body, _ = touchable(model, float(radius), exaggeration)
    at = np.arange(count) * speed / rate
    places = np.column_stack([np.interp(at, s, path[:, k]) for k in range(3)])
    height = heights_along(body, places)
    events, sizes = kinks(height, speed / rate)
    return Vibration(float(rate), height, events / rate, sizes, speed)


def heights_along(body: ProxyBody, places: FloatArray) -> FloatArray:
    """(N,) heights of the ball over the base's own trace where it stands over places (N, 3) of the base, m."""
    near = body.base.query(places)
    path = near.points + body.radius * near.normals
    felt = pressed_along(body, path, -near.normals, PRESSING)
    return np.asarray(np.einsum("ij,ij->i", felt.centers - near.points, near.normals) - body.radius)


def kinks(height: FloatArray, spacing: float) -> tuple[FloatArray, FloatArray]:
    """(places in samples, jumps of the slope) of kinks of heights at even places.

    A kink shows in one second difference as its whole jump, or in two; a curve's second difference is its curvature
    times the spacing, a hundred times less. Two lines beside the kink say where between the samples it lies.
    """
    if len(height) < 8:
        return np.zeros(0), np.zeros(0)
    second = np.diff(height, 2) / spacing
    smooth = np.median(np.abs(second))
    size = np.abs(second[:-1] + second[1:])
    floor = max(LEAST_KINK, 8.0 * float(smooth))
    found: list[tuple[float, float]] = []
    for i in np.flatnonzero(size > floor):
        beside = size[max(i - 3, 0) : i + 4]
        if size[i] < beside.max() or (found and i - found[-1][0] < 3):
            continue
        both = second[i] + second[i + 1]
        found.append((i + 1 + second[i + 1] / both, float(both)))
    return np.array([place for place, _ in found]), np.array([jump for _, jump in found])
