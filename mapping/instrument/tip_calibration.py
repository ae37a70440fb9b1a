"""Tip calibration: radius and reference point of a fingertip from a sphere or ring of known size."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mapping import CalibrationError, FloatArray, Trace
from mapping.instrument.noise import Noise, estimate_noise

SHAPES = ("sphere", "ring")
# 90 % of a normal distribution lie within so many standard deviations
SDS_PER_90_HALF_WIDTH = 1.6448536269514722
SECTORS, BANDS = 12, 3


@dataclass(frozen=True, eq=False)
class TipCalibration:
    """What a known sphere or ring says about the tip.

    Args:
        radius: of the tip, m.
        radius_sd: its standard deviation, m, that of the reference included.
        center: (3,) of the reference as the machine sees it, m: where the tip's reference point lies.
        center_sd: (3,) standard deviations, m.
        noise: of the radial distance along the sweeps.
        range: largest minus smallest distance from the centre, m (ISO 10360-4 and -5).
        directions: (M, 3) unit directions from the reference's centre, one per inspected patch.
        deviations: (M,) mean radial deviation there, m.
        deviations_sd: (M,) of these means, m.
        samples: how many there were.
    """

    radius: float
    radius_sd: float
    center: FloatArray
    center_sd: FloatArray
    noise: Noise
    range: float
    directions: FloatArray
    deviations: FloatArray
    deviations_sd: FloatArray
    samples: int

    @property
    def interval(self) -> tuple[float, float]:
        """Lower and upper end of the radius's 90 % interval, m."""
        return (
            self.radius - SDS_PER_90_HALF_WIDTH * self.radius_sd,
            self.radius + SDS_PER_90_HALF_WIDTH * self.radius_sd,
        )

    def record(self) -> dict[str, Any]:
        """JSON values, SI units."""
        return {
            "radius": self.radius,
            "radius_sd": self.radius_sd,
            "interval_90": list(self.interval),
            "center": self.center.tolist(),
            "center_sd": self.center_sd.tolist(),
            "white": self.noise.white,
            "correlated": self.noise.correlated,
            "correlation_length": self.noise.length,
            "range": self.range,
            "samples": self.samples,
            "directions": self.directions.tolist(),
            "deviations": self.deviations.tolist(),
            "deviations_sd": self.deviations_sd.tolist(),
        }


def calibrate_tip(
    trace: Trace,
    reference: float,
    *,
    shape: str = "sphere",
    axis: ArrayLike = (0.0, 0.0, 1.0),
    reference_sd: float = 0.0,
    speed: float | None = None,
) -> TipCalibration:
    """Tip radius and reference centre from ball centres on a sphere (outside) or in a ring (inside).

    Generalised least squares: the noise of the radial distance, white and correlated along the sweeps, is
    estimated from the residuals of a first fit and whitens the second, so the stated uncertainty is that of
    the correlated samples.

    Args:
        trace: centres; its own tip radius is not used.
        reference: radius of the sphere, or inner radius of the ring, m.
        shape: "sphere" or "ring".
        axis: (3,) of the ring.
        reference_sd: standard uncertainty of `reference`, m.
        speed: along the sweeps, m/s; None: estimated from thinned centres (noise lengthens the path).

    Raises:
        CalibrationError: an unknown shape, too few samples, or samples that do not enclose a centre.
    """
    if shape not in SHAPES:
        raise CalibrationError(f"unknown reference shape {shape!r}; possible: {', '.join(SHAPES)}")
    if len(trace) < 16:
        raise CalibrationError(f"calibration needs at least 16 contacts; found {len(trace)}")
    frame = _plane(np.asarray(axis, dtype=np.float64)) if shape == "ring" else np.eye(3)
    points = trace.centers @ frame.T
    along, cuts = _arclength(trace, speed)
    start = _algebraic(points)
    flat = Noise(1.0)
    guess, _ = _fit(points, start, flat, along, cuts)
    noise = _floored(estimate_noise(_radial(points, guess), along), points)
    found, covariance = _fit(points, guess, noise, along, cuts)
    residual = _radial(points, found)
    sd = np.sqrt(np.diag(covariance))
    radius = found[-1] - reference if shape == "sphere" else reference - found[-1]
    if radius <= 0:
        raise CalibrationError(
            f"the fit gives a {shape} of {found[-1]:.6g} m under the ball's centre, the reference is {reference:g} m: "
            "no tip radius fits; is the shape right?"
        )
    center, center_sd = found[:-1] @ frame, np.abs(sd[:-1] @ frame)
    return TipCalibration(
        float(radius),
        float(np.hypot(sd[-1], reference_sd)),
        center,
        center_sd,
        noise,
        float(np.ptp(residual)),
        *_map(trace.centers - center, residual, along, noise),
        len(trace),
    )


def _plane(axis: FloatArray) -> FloatArray:
    """(2, 3) orthonormal rows perpendicular to the axis."""
    axis = axis / np.linalg.norm(axis)
    first = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(axis, first)])


def _algebraic(points: FloatArray) -> FloatArray:
    """(D + 1,) centre and radius by linear least squares on |p|^2, coordinates centred and scaled."""
    middle = points.mean(axis=0)
    scale = float(np.abs(points - middle).max())
    p = (points - middle) / scale
    design = np.column_stack([2.0 * p, np.ones(len(p))])
    solution, _, rank, _ = np.linalg.lstsq(design, (p**2).sum(axis=1), rcond=1e-9)
    if rank < design.shape[1]:
        raise CalibrationError("the contacts lie in a plane or on a line: sweep over the reference in two directions")
    center = solution[:-1]
    return np.append(center * scale + middle, scale * np.sqrt(max(solution[-1] + center @ center, 1e-30)))


def _radial(points: FloatArray, found: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.norm(points - found[:-1], axis=1) - found[-1])


def _fit(
    points: FloatArray, start: FloatArray, noise: Noise, along: FloatArray, cuts: list[slice]
) -> tuple[FloatArray, FloatArray]:
    """Gauss-Newton on the radial distances; parameters (D + 1,) and their covariance."""
    found = start.copy()
    for _ in range(50):
        away = points - found[:-1]
        distance = np.linalg.norm(away, axis=1)
        columns = np.column_stack([away / distance[:, None], np.ones(len(points)), distance - found[-1]])
        white = np.concatenate([noise.whiten(columns[cut], along[cut])[0] for cut in cuts])
        jacobian, residual = white[:, :-1], white[:, -1]
        normal = jacobian.T @ jacobian
        step = np.linalg.solve(normal, jacobian.T @ residual)
        found = found + step
        if np.abs(step).max() < 1e-12 * found[-1]:
            break
    # what the noise model misses shows in the whitened residuals
    return found, np.linalg.inv(normal) * float(residual @ residual) / (len(residual) - len(found))


def _floored(noise: Noise, points: FloatArray) -> Noise:
    """Noise-free samples are only as good as their float64."""
    floor = 1e-12 * float(np.abs(points).max())
    return Noise(max(noise.white, floor), noise.correlated, noise.length)


def _arclength(trace: Trace, speed: float | None) -> tuple[FloatArray, list[slice]]:
    """(N,) distance along each sweep, from time and speed, and the slices of the sweeps."""
    along, cuts, begin = np.empty(len(trace)), [], 0
    for _, sweep in trace.sweeps():
        cut = slice(begin, begin + len(sweep))
        thin = sweep.centers[:: max(1, len(sweep) // 40)]
        length = float(np.linalg.norm(np.diff(thin, axis=0), axis=1).sum())
        elapsed = sweep.t - sweep.t[0]
        rate = length / max(float(elapsed[-1]), 1e-300) if speed is None else speed
        along[cut] = elapsed * rate
        cuts.append(cut)
        begin = cut.stop
    return along, cuts


def _map(
    away: FloatArray, residual: FloatArray, along: FloatArray, noise: Noise
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mean deviation by direction: SECTORS in azimuth, BANDS of equal area in elevation."""
    unit = away / np.linalg.norm(away, axis=1, keepdims=True)
    azimuth = np.floor((np.arctan2(unit[:, 1], unit[:, 0]) / (2 * np.pi) % 1.0) * SECTORS).astype(np.int64) % SECTORS
    band = np.clip(np.floor((unit[:, 2] + 1.0) / 2.0 * 2 * BANDS).astype(np.int64), 0, 2 * BANDS - 1)
    cell = band * SECTORS + azimuth
    step = float(np.median(np.abs(np.diff(along)))) if len(along) > 1 else 0.0
    rows = []
    for number in np.unique(cell):
        inside = cell == number
        count = int(inside.sum())
        independent = max(1.0, count * step / (2.0 * max(noise.length, 1e-300)))
        sd = np.sqrt(noise.white**2 / count + noise.correlated**2 / independent)
        mean = unit[inside].mean(axis=0)
        rows.append((*(mean / np.linalg.norm(mean)), residual[inside].mean(), sd))
    table = np.array(rows)
    return table[:, :3], table[:, 3], table[:, 4]
