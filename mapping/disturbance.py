"""Disturbance: a stretch of one height profile that the base does not explain, and the shape it has."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapping.height_profile import HeightProfile
from mapping.matched_filter import Bank, cap_bins
from mapping.noise import Noise

FloatArray = NDArray[np.float64]

# A stretch reaches as far as the smoothed height exceeds this share of the crest (or the noise).
SKIRT = 0.03
# A crest beside a higher one counts if the valley between them is deeper than this share of the lower.
PROMINENCE = 0.2
# A top flat over more than this share of the half-width is a plateau (two steps), not a crest.
FLAT_TOP = 0.6
FLATNESS = (0.0, 0.3, 0.5, 0.7, 0.85, 0.95)


@dataclass(frozen=True)
class Disturbance:
    """A crest (or dip) or a plateau of one profile.

    Args:
        place: arclength of the crest, or of the plateau's middle, m.
        start, stop: arclengths between which the profile is disturbed, m.
        height: signed height of the crest, m.
        height_sd, place_sd: standard deviations, m.
        half_width: of the fitted cap, m.
        flat: half-length of the flat top, m; 0 for a crest.
        curvature: of the trace at the crest, 1/m.
        snr: signal-to-noise ratio.
    """

    place: float
    start: float
    stop: float
    height: float
    height_sd: float
    place_sd: float
    half_width: float
    flat: float
    curvature: float
    snr: float


def find_disturbances(
    profile: HeightProfile, bank: Bank, noise: Noise, threshold: float, tip_radius: float
) -> tuple[Disturbance, ...]:
    """Every disturbance above the threshold, the strongest first.

    Each round takes the candidates that nothing stronger overlaps, measures them, removes their stretches
    from the profile and looks again, until nothing exceeds the threshold.
    """
    height = profile.height.copy()
    found: list[Disturbance] = []
    for _ in range(50):
        accepted = [c for c in _dominant(_candidates(height, bank, threshold, tip_radius))]
        if not accepted:
            break
        for place, half_width, crest in accepted:
            begin, end = _stretch(height, place, half_width, crest, profile, noise, tip_radius)
            new = _measure(height, begin, end, crest, profile, noise, bank, tip_radius)
            found += [d for d in new if abs(d.snr) >= threshold and not _side_lobe(d, found, bank.drift > 0)]
            height[begin:end] = np.interp(
                np.arange(begin, end), [begin - 1, end], _shoulders(height, begin, end, bank.drift > 0)
            )
    return tuple(found)


def _candidates(
    height: FloatArray, bank: Bank, threshold: float, tip_radius: float
) -> list[tuple[float, int, float, float]]:
    """(signal-to-noise, bin, half-width in bins, height) of local maxima over place for every width."""
    result = []
    for f in bank.filters:
        if f.half_width > 0.6 * len(height) * bank.spacing or len(height) < 2 * f.coarse:
            continue
        crest, sd = f.heights(height)
        snr = np.abs(crest) / sd
        # the tip cannot draw anything sharper than itself
        snr = np.where(np.abs(crest) > 2.0 * f.half_width**2 / (2 * tip_radius), 0.0, snr)
        around = np.concatenate([[-1.0], snr, [-1.0]])
        peaks = np.flatnonzero((snr > threshold) & (snr >= around[:-2]) & (snr > around[2:]))
        place = ((peaks + 0.5) * f.coarse).astype(int)
        result += [
            (float(snr[p]), int(i), f.half_width / bank.spacing, float(crest[p]))
            for p, i in zip(peaks, place, strict=True)
        ]
    return result


def _dominant(candidates: list[tuple[float, int, float, float]]) -> list[tuple[int, float, float]]:
    """Place, half-width and height of the candidates that no stronger one overlaps, the strongest first."""
    kept: list[tuple[int, float, float]] = []
    blocked: list[tuple[int, float]] = []
    for _, place, half_width, crest in sorted(candidates, reverse=True):
        if all(abs(place - other) >= half_width + width for other, width in blocked):
            kept.append((place, half_width, crest))
        blocked.append((place, half_width))
    return kept


def _smooth(height: FloatArray, size: int) -> FloatArray:
    """Running mean over 2 size + 1 bins, shorter at the ends."""
    sums = np.concatenate([[0.0], np.cumsum(height)])
    index = np.arange(len(height))
    low, high = np.maximum(index - size, 0), np.minimum(index + size + 1, len(height))
    return np.asarray((sums[high] - sums[low]) / (high - low))


def _smoothing(
    crest: float, half_width: float, profile: HeightProfile, noise: Noise, tip_radius: float
) -> tuple[int, float]:
    """Half-size in bins of a running mean that keeps every physical structure, and the sd of its output."""
    sharpest = np.sqrt(2 * tip_radius * abs(crest))
    size = int(0.2 * min(sharpest, half_width * profile.spacing) / profile.spacing)
    count = 2 * size + 1
    covariance = noise.block_covariances(1, count * profile.spacing, count * profile.samples)
    return size, float(np.sqrt(covariance[0]))


def _stretch(
    height: FloatArray,
    place: int,
    half_width: float,
    crest: float,
    profile: HeightProfile,
    noise: Noise,
    tip_radius: float,
) -> tuple[int, int]:
    """First and past-last bin around a place within which the profile stays off the base on one side."""
    size, sd = _smoothing(crest, half_width, profile, noise, tip_radius)
    low = max(0, int(place - half_width))
    high = min(len(height), int(place + half_width) + 2)
    smooth = np.sign(crest) * _smooth(height, size)
    off = smooth > max(SKIRT * abs(crest), 2.5 * sd)
    below = np.flatnonzero(~off[:low])
    above = np.flatnonzero(~off[high:])
    begin = 0 if len(below) == 0 else int(below[-1]) + 1
    end = len(height) if len(above) == 0 else high + int(above[0])
    return min(begin, low), max(end, high)


def _shoulders(height: FloatArray, begin: int, end: int, drift: bool) -> tuple[float, float]:
    """Levels to join when a stretch is removed: the base itself, or what stands beside it."""
    if not drift:
        return 0.0, 0.0
    size = max(2, (end - begin) // 3)
    left, right = height[max(0, begin - size) : begin], height[end : end + size]
    low = float(np.median(left)) if len(left) else float(np.median(right)) if len(right) else 0.0
    return low, float(np.median(right)) if len(right) else low


def _side_lobe(new: Disturbance, found: list[Disturbance], drift: bool) -> bool:
    """True for what is left of a stronger disturbance whose shape is not quite a cap."""
    for old in found:
        reach = (old.stop - old.start) * (1.0 if drift else 0.6) + new.half_width
        if abs(new.place - old.place) < reach and abs(new.height) < 0.12 * abs(old.height):
            return True
    return False


def _measure(
    height: FloatArray,
    begin: int,
    end: int,
    crest: float,
    profile: HeightProfile,
    noise: Noise,
    bank: Bank,
    tip_radius: float,
) -> list[Disturbance]:
    """The crests of a stretch, each fitted between the valleys beside it."""
    size, sd = _smoothing(crest, (end - begin) / 2, profile, noise, tip_radius)
    smooth = np.sign(crest) * _smooth(height, size)[begin:end]
    tops, valleys = _crests(smooth, sd)
    bounds = [begin, *(begin + v for v in valleys), end]
    return [
        _fit(height, low, high, begin + top, np.sign(crest), profile, noise, bank)
        for top, low, high in zip(tops, bounds[:-1], bounds[1:], strict=True)
    ]


def _crests(smooth: FloatArray, sd: float) -> tuple[list[int], list[int]]:
    """Maxima separated by valleys that are deep against the noise and the lower maximum; and those valleys."""
    tops, valleys = [0], []
    lowest = 0
    for i in range(1, len(smooth)):
        if smooth[i] < smooth[lowest]:
            lowest = i
        needed = max(PROMINENCE * min(smooth[tops[-1]], smooth[i]), 5 * sd)
        if smooth[i] > smooth[tops[-1]] and (lowest <= tops[-1] or smooth[tops[-1]] - smooth[lowest] < needed):
            tops[-1] = lowest = i
        elif lowest > tops[-1] and smooth[i] - smooth[lowest] > needed and smooth[tops[-1]] - smooth[lowest] > needed:
            valleys.append(lowest)
            tops.append(i)
            lowest = i
        elif smooth[i] > smooth[tops[-1]]:
            tops[-1] = lowest = i
    return tops, valleys


def _fit(
    height: FloatArray,
    low: int,
    high: int,
    top: int,
    sign: float,
    profile: HeightProfile,
    noise: Noise,
    bank: Bank,
) -> Disturbance:
    """Least squares of a cap with a flat top over place, half-width and flatness, seen through the noise."""
    spacing = profile.spacing
    margin = max(3, (high - low) // 4)
    window = slice(max(0, low - margin), min(len(height), high + margin))
    step = max(1, (window.stop - window.start) // 160)
    whole = (window.stop - window.start) // step * step
    x = (window.start + (np.arange(whole // step) + 0.5) * step - 0.5) * spacing
    values = height[window.start : window.start + whole].reshape(-1, step).mean(axis=1)
    width = step * spacing
    covariance = noise.block_covariances(len(x), width, profile.samples * step)
    lags = np.abs(np.subtract.outer(np.arange(len(x)), np.arange(len(x))))
    root = np.linalg.cholesky(covariance[lags] + 1e-12 * covariance[0] * np.eye(len(x)))
    nuisance = ((x - x.mean()) / max(np.ptp(x), width))[:, None] ** np.arange(bank.drift)
    columns = np.linalg.solve(root, np.column_stack([values, nuisance]))

    def score(place: float, half_width: float, flat: float) -> tuple[float, float, float]:
        template = np.linalg.solve(root, cap_bins(x - place, half_width, width, flat * half_width))
        target = columns[:, 0]
        if bank.drift:
            basis = np.linalg.qr(columns[:, 1:])[0]
            template = template - basis @ (basis.T @ template)
            target = target - basis @ (basis.T @ target)
        information = float(template @ template)
        if information <= 0:
            return -np.inf, 0.0, np.inf
        amplitude = float(template @ target) / information
        gain = amplitude**2 * information if amplitude * sign > 0 else -np.inf
        return gain, amplitude, float(1 / np.sqrt(information))

    middle = spacing * 0.5 * (low + high - 1)
    half = max(0.5 * (high - low) * spacing, 1.5 * spacing)
    best = max(
        _climb(score, place, half, spacing, flat) for flat in FLATNESS for place in dict.fromkeys((middle, top * spacing))
    )
    sharp = _climb(score, best[1], best[2], spacing, 0.0)
    crest = max(sharp, _climb(score, top * spacing, half, spacing, 0.0))
    if best[3] < FLAT_TOP or best[0] - crest[0] < 12.0:
        best = crest
    gain, place, half_width, flat = best
    _, amplitude, sd = score(place, half_width, flat)
    slope = (score(place + 0.05 * half_width, half_width, flat)[0] + score(place - 0.05 * half_width, half_width, flat)[0] - 2 * gain) / (0.05 * half_width) ** 2
    place_sd = float(np.sqrt(-2 / slope)) if np.isfinite(slope) and slope < 0 else half_width
    edge = half_width * (1 - flat)
    offset = profile.start
    return Disturbance(
        place + offset,
        low * spacing + offset,
        high * spacing + offset,
        amplitude,
        sd,
        min(place_sd, half_width),
        half_width,
        flat * half_width if flat >= FLAT_TOP else 0.0,
        2 * amplitude / edge**2,
        float(np.sqrt(max(gain, 0.0))),
    )


def _climb(score, place: float, half_width: float, spacing: float, flat: float):  # type: ignore[no-untyped-def]
    """Pattern search over place and half-width from a start; (gain, place, half-width, flatness)."""
    best = score(place, half_width, flat)[0]
    shift, factor = 0.25 * half_width, 1.3
    for _ in range(60):
        trials = [
            (place - shift, half_width),
            (place + shift, half_width),
            (place, half_width * factor),
            (place, max(half_width / factor, 1.2 * spacing)),
        ]
        gains = [score(p, w, flat)[0] for p, w in trials]
        k = int(np.argmax(gains))
        if gains[k] > best:
            best, (place, half_width) = gains[k], trials[k]
        else:
            shift, factor = shift / 2, np.sqrt(factor)
            if shift < 1e-3 * half_width:
                break
    return best, place, half_width, flat
