"""A term of a noise: one process or oscillator, and what its covariance is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import NoiseError


@dataclass(frozen=True)
class Term:
    """One correlated part of a noise: sd^2 exp(-d / length) cos(2 pi d / wavelength) at the distance d.

    Args:
        sd: standard deviation, m.
        length: correlation length, m.
        wavelength: of an oscillator that noise kicks, m: a tone where its length is long, a resonance where it is
            short; infinite for an Ornstein-Uhlenbeck process.

    Raises:
        NoiseError: a value that is not positive, or a level or length that is not finite.

    Reference: theory equation 6.16.
    """

    sd: float
    length: float
    wavelength: float = np.inf

    def __post_init__(self) -> None:
        if not (np.isfinite([self.sd, self.length]).all() and min(self.sd, self.length, self.wavelength) > 0):
            found = (self.sd, self.length, self.wavelength)
            raise NoiseError(f"a term of a noise needs positive values, level and length finite; found {found}")

    @property
    def turns(self) -> bool:
        """True for an oscillator."""
        return bool(np.isfinite(self.wavelength))

    @property
    def rate(self) -> complex:
        """1 / length + 2 pi i / wavelength, 1/m: the covariance is the real part of sd^2 exp(-rate d)."""
        return complex(1.0 / self.length, 2.0 * np.pi / self.wavelength)
