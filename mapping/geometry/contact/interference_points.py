"""Interference points: a sliding ball touches two places at once, its path has a kink (the paper, section 2.2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mapping import BoolArray, FloatArray
from mapping.geometry.contact.commanded_path import CommandedPath
from mapping.geometry.contact.first_contact import BallContact, Contacts

HALVINGS = 60  # of the spacing: to the last bit of a place


def interference_points(ball: BallContact, path: ArrayLike, approach: ArrayLike, spacing: float) -> Contacts:
    """Interference points of a ball that slides along a commanded path.

    Between samples where the contact jumps over the body while the centre moves on, the jump is bisected
    to rounding. Of the two halves of an interval the one with the larger jump is followed; the other one
    too while its contact moves more than half as far again as its centre. So the spacing should be at
    most half the width of the narrowest dent that matters: of two jumps closer together than the spacing
    one may be overlooked. Jumps below 1e-4 radii are not looked for.

    Args:
        ball: the ball and the body.
        path, approach, spacing: as for `BallContact.slide`.

    Returns:
        Contacts in the order of the path, each with count >= 2.

    Raises:
        ContactError: as `BallContact.slide`.
    """
    commanded = CommandedPath(path, approach)
    places = commanded.places(spacing)
    rest = ball.press(*commanded.at(places))
    low, high = places[:-1], places[1:]
    before, after = rest.select(np.arange(len(low))), rest.select(np.arange(1, len(places)))
    for _ in range(HALVINGS):
        jumps = _jump(before, after) > 1e-4 * ball.tip_radius
        low, high, before, after = low[jumps], high[jumps], before.select(jumps), after.select(jumps)
        if len(low) == 0:
            break
        middle = 0.5 * (low + high)
        between = ball.press(*commanded.at(middle))
        first, second = _jump(before, between), _jump(between, after)
        to_first = (first >= second) | (first > 1.5 * _travel(before, between))
        to_second = (first < second) | (second > 1.5 * _travel(between, after))
        low, high = np.append(low[to_first], middle[to_second]), np.append(middle[to_first], high[to_second])
        before, after = _append(before, between, to_first, to_second), _append(between, after, to_first, to_second)
    found = ball.press(*commanded.at(np.unique(np.append(low, high))))
    return _one_of_each(found.select(found.interference), ball.tip_radius)


def _jump(before: Contacts, after: Contacts) -> FloatArray:
    """(N,) distance of the contact points, m; 0 where there is no contact."""
    return np.asarray(np.nan_to_num(np.linalg.norm(after.points - before.points, axis=1)))


def _travel(before: Contacts, after: Contacts) -> FloatArray:
    """(N,) distance of the centres, m; inf where there is no contact."""
    return np.asarray(np.nan_to_num(np.linalg.norm(after.centers - before.centers, axis=1), nan=np.inf))


def _append(first: Contacts, second: Contacts, of_first: BoolArray, of_second: BoolArray) -> Contacts:
    one, other = vars(first.select(of_first)), vars(second.select(of_second))
    return Contacts(**{name: np.concatenate([one[name], other[name]]) for name in one})


def _one_of_each(found: Contacts, tip_radius: float) -> Contacts:
    """The same point found from both of its sides is one."""
    steps = np.linalg.norm(np.diff(found.centers, axis=0), axis=1)
    return found.select(np.append(True, steps > 1e-9 * tip_radius)[: len(found)])
