"""Wide lines: is what several sweeps show as one wide section two lines side by side?"""

from __future__ import annotations

from mapping import Feature, MappingError
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
