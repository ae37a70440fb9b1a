"""Trace: what the finger recorded while it was in contact."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mapping.arrays import BoolArray, FloatArray, IntArray, Scalar
from mapping.errors import TraceError


@dataclass(frozen=True, eq=False)
class Trace:
    """Ball centres in contact, in the order of time, with what else the finger felt.

    Args:
        t: (N,) times, s.
        centers: (N, 3) centres of the spherical fingertip, m, object frame.
        sweep: (N,) number of the sweep that each sample belongs to.
        tip_radius: radius of the fingertip, m, positive.
        normals: (N, 3) outward contact normals (unit), or None: the log has positions alone.
        contacts: (N, 3) contact points, m, or None.
        force: (N, 3) contact force, N, or None.
        resolution: step of the positions, m: of a stage that counts steps or rounds what it reports. 0: none.

    Raises:
        TraceError: arrays of different length, values that are not finite, a radius that is not positive, a
            resolution that is negative.
    """

    t: FloatArray
    centers: FloatArray
    sweep: IntArray
    tip_radius: float
    normals: FloatArray | None = field(default=None)
    contacts: FloatArray | None = field(default=None)
    force: FloatArray | None = field(default=None)
    resolution: float = 0.0

    def __post_init__(self) -> None:
        radius = float(self.tip_radius)
        if not (np.isfinite(radius) and radius > 0):
            raise TraceError(f"tip radius must be a positive length in metres; found {self.tip_radius!r}")
        object.__setattr__(self, "tip_radius", radius)
        if not 0.0 <= self.resolution < np.inf:
            raise TraceError(f"the positions' resolution must be a length in metres, or 0; found {self.resolution!r}")
        count = len(np.asarray(self.centers))
        self._freeze("t", (count,), np.float64)
        self._freeze("centers", (count, 3), np.float64)
        self._freeze("sweep", (count,), np.int64)
        for name in ("normals", "contacts", "force"):
            if getattr(self, name) is not None:
                self._freeze(name, (count, 3), np.float64)

    def __repr__(self) -> str:
        sweeps, tip = len(np.unique(self.sweep)), f"{1e3 * self.tip_radius:g} mm"
        return f"<{type(self).__name__}: {len(self.t)} samples in {sweeps} sweeps of a tip of {tip}>"

    def _freeze(self, name: str, shape: tuple[int, ...], dtype: type) -> None:
        given = getattr(self, name)
        # an array that nobody can write to any more needs no copy: one that is read-only, and no view of another
        final = isinstance(given, np.ndarray) and given.base is None and not given.flags.writeable
        array: NDArray[Any] = np.asarray(given, dtype=dtype) if final else np.array(given, dtype=dtype)
        if array.shape != shape:
            raise TraceError(f"trace field {name} must have shape {shape} to match centers; found {array.shape}")
        finite = np.isfinite(array)
        if not finite.all():
            bad = ~(finite if array.ndim == 1 else finite.all(axis=1))
            raise TraceError(
                f"trace field {name} must be finite; {int(bad.sum())} of {len(array)} samples are not, "
                f"the first is sample {int(bad.argmax())}"
            )
        array.setflags(write=False)
        object.__setattr__(self, name, array)

    def __len__(self) -> int:
        return len(self.t)

    @property
    def has_contact_data(self) -> bool:
        """True if contact normals were recorded (algorithms 1 and 2 need them)."""
        return self.normals is not None

    @classmethod
    def of_readings(cls, t: ArrayLike, centers: ArrayLike, sweep: ArrayLike, tip_radius: float, **more: Any) -> Trace:
        """The readings of a device, without those that are not finite: a driver keeps what a bad frame did not spoil.

        Args:
            more: the other fields.

        Raises:
            TraceError: there are readings, but not one of them is finite.
        """
        arrays = {"t": np.asarray(t), "centers": np.asarray(centers), "sweep": np.asarray(sweep)}
        arrays |= {
            name: np.asarray(more[name]) for name in ("normals", "contacts", "force") if more.get(name) is not None
        }
        count = len(arrays["t"])
        good = np.ones(count, dtype=bool)
        for array in arrays.values():
            good &= np.isfinite(array).reshape(count, -1).all(axis=1) if count else good
        if count and not good.any():
            raise TraceError(f"none of {count} readings is finite; is the sensor connected?")
        return cls(tip_radius=tip_radius, **(more | {name: array[good] for name, array in arrays.items()}))

    @classmethod
    def from_profile(cls, x: ArrayLike, z: ArrayLike, tip_radius: float, t: ArrayLike | None = None) -> Trace:
        """A single profile x, z (N,) in metres as one sweep along x with z outward and y = 0."""
        x_array, z_array = np.asarray(x, dtype=np.float64), np.asarray(z, dtype=np.float64)
        if x_array.ndim != 1 or x_array.shape != z_array.shape:
            raise TraceError(f"a profile needs x and z of one length; found {x_array.shape} and {z_array.shape}")
        centers = np.column_stack([x_array, np.zeros_like(x_array), z_array])
        times = np.arange(len(x_array), dtype=np.float64) if t is None else np.asarray(t, dtype=np.float64)
        return cls(times, centers, np.zeros(len(x_array), dtype=np.int64), tip_radius)

    @classmethod
    def concatenate(cls, traces: Sequence[Trace]) -> Trace:
        """One trace of all samples, in the given order; optional fields survive if all parts have them; the
        coarsest resolution counts.

        Raises:
            TraceError: no traces, or different tip radii.
        """
        if not traces:
            raise TraceError("cannot concatenate no traces; at least one is needed")
        radii = {trace.tip_radius for trace in traces}
        if len(radii) > 1:
            raise TraceError(f"traces to concatenate must share one tip radius; found {sorted(radii)} m")
        parts: dict[str, FloatArray | None] = {}
        for name in ("normals", "contacts", "force"):
            values = [getattr(trace, name) for trace in traces]
            parts[name] = None if any(v is None for v in values) else _final(np.concatenate(values))
        return cls(
            _final(np.concatenate([trace.t for trace in traces])),
            _final(np.concatenate([trace.centers for trace in traces])),
            _final(np.concatenate([trace.sweep for trace in traces])),
            traces[0].tip_radius,
            **parts,
            resolution=max(trace.resolution for trace in traces),
        )

    def select(self, index: ArrayLike | slice) -> Trace:
        """The samples that a mask, an index array or a slice picks."""
        key = index if isinstance(index, slice) else np.asarray(index)

        def pick(array: FloatArray | None) -> FloatArray | None:
            return None if array is None else _final(array[key])

        return Trace(
            _final(self.t[key]),
            _final(self.centers[key]),
            _final(self.sweep[key]),
            self.tip_radius,
            pick(self.normals),
            pick(self.contacts),
            pick(self.force),
            self.resolution,
        )

    def sweeps(self) -> Iterator[tuple[int, Trace]]:
        """Each run of consecutive samples with one sweep number: (number, its trace)."""
        if len(self) == 0:
            return
        cuts = np.flatnonzero(np.diff(self.sweep)) + 1
        for start, stop in zip([0, *cuts], [*cuts, len(self)], strict=True):
            yield int(self.sweep[start]), self._view(slice(int(start), int(stop)))

    def backwards(self) -> str:
        """Where times decrease within a sweep, as a sentence; "" if none does."""
        back = 1 + np.flatnonzero((np.diff(self.t) < 0) & (np.diff(self.sweep) == 0))
        if not len(back):
            return ""
        first = int(back[0])
        return (
            f"{len(back)} of {len(self)} samples lie before their predecessor, the first is sample {first} of sweep "
            f"{int(self.sweep[first])}, {self.t[first - 1] - self.t[first]:.3g} s before"
        )

    def _view(self, cut: slice | BoolArray) -> Trace:
        """Some samples; not checked again, and sharing the memory of these if they are consecutive."""
        part = object.__new__(Trace)
        for each in fields(self):
            value = getattr(self, each.name)
            object.__setattr__(part, each.name, value[cut] if isinstance(value, np.ndarray) else value)
        return part

    def arclength(self) -> FloatArray:
        """(N,) distance travelled by the centre since the first sample, m (noise lengthens it)."""
        steps = np.linalg.norm(np.diff(self.centers, axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(steps)]) if len(self) else np.zeros(0)


def _final(array: NDArray[Scalar]) -> NDArray[Scalar]:
    """The array, which nobody else holds, read-only: the trace that it is made for keeps it without a copy."""
    array.setflags(write=False)
    return array
