"""ExpectedSurface: how far the tip may go before it must have felt something."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mapping import FloatArray, Surface
from mapping.geometry.contact import BallContact

# The way of a tip that overlaps the model where it begins, in a dent or in contact, is looked at from so many tip radii
# before. One that is free there is not: what it has passed, a wire that it leaves sideways, does not lie in its way. A
# tip that is less than two radii beyond a surface overlaps it
BACK = 2.0


@dataclass(frozen=True, eq=False)
class ExpectedSurface:
    """A model of the body where it stands, and how wrong it may be.

    Args:
        surface: m, object frame.
        tip_radius: m.
        beyond: how far the tip may go behind the place where it should have touched, m: a sensor that feels nothing
            until there is dead, or the body is elsewhere.
    """

    surface: Surface
    tip_radius: float
    beyond: float
    _ball: BallContact = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_ball", BallContact(self.surface, self.tip_radius))

    def bounds(self, points: FloatArray, directions: FloatArray) -> FloatArray:
        """(N,) farthest that the tip centre may go from points (N, 3) along unit directions (N, 3), m.

        inf where no body is expected, or where the tip would be inside of it all the way.
        """
        ahead = self._ball.first_contact(points, directions)
        back = BACK * self.tip_radius
        found = self._ball.first_contact(points - back * directions, directions)
        behind = np.where(found.overlap, np.inf, found.distance - back)
        return np.where(ahead.overlap, behind, ahead.distance) + self.beyond
