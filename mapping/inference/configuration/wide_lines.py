"""Wide details: is what several sweeps show as one wide section two lines side by side, or a round bump?"""

from __future__ import annotations

from dataclasses import replace

from mapping import Details, Feature, MappingError
from mapping.inference.configuration.configuration import Configuration, fitted, part_of
from mapping.inference.configuration.neighbourhood import Places, neighbourhood
from mapping.inference.configuration.proposals import sections
from mapping.inference.families import Surroundings
from mapping.inference.kinds import kind_of


def is_two(line: Feature, places: Places, around: Surroundings, false_alarms_per_metre: float) -> bool:
    """True of a line that stands out, if two alike side by side are likelier than one of any section, and leave no more
    than noise: where the ball sinks between both by less than the noise of a sweep, each sweep shows one.

    Args:
        line: as its sections tell it.
        places: heights that it is weighed on.
        around: trace, base and noise.
        false_alarms_per_metre: accepted rate of invented features, 1/m of path.
    """
    if not kind_of(line).line or kind_of(line).sign < 0 or line.closed:
        return False
    place = neighbourhood([line], [], places, around, false_alarms_per_metre)
    if place is None:
        return False
    try:
        one = fitted([part_of(line, place)], place)
        assert one is not None
        other = [fitted(parts, place) for parts in sections(one)]
    except MappingError:  # no course over the base: of no family
        return False
    best: Configuration = max([one, *(each for each in other if each is not None)], key=lambda each: each.log_odds)
    return len(best.kinds) > 1 and best.fits


def as_round(
    spot: Feature, places: Places, around: Surroundings, false_alarms_per_metre: float
) -> tuple[Feature, Configuration] | None:
    """What stands out as a spot of a family, and that where it fits, if one leaves no more than noise on all sweeps
    about it; else None.

    The highest of its sweeps is no measure of a cone, whose tip may lie between two of them: only what all of them
    felt, and the rows beside, tells that.

    Args:
        spot: as its sections tell it.
        places: heights that it is weighed on.
        around: trace, base and noise.
        false_alarms_per_metre: accepted rate of invented features, 1/m of path.
    """
    if kind_of(spot).line or kind_of(spot).sign < 0 or spot.evidence.crossings < 2:
        return None
    plain = replace(spot, details=Details(), notes=())
    place = neighbourhood([plain], [], places, around, false_alarms_per_metre)
    if place is None:
        return None
    one = fitted([part_of(plain, place)], place)
    assert one is not None
    others = () if one.fits else (fitted(each, place) for each in sections(one))
    best = next((each for each in (one, *others) if each is not None and each.fits), None)
    return None if best is None else (plain, best)
