"""Search: from what the rules propose to the configuration with the highest odds, by accepted proposals alone."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mapping import FloatArray, MappingError
from mapping.inference.configuration.configuration import Configuration, Part, fitted, laid
from mapping.inference.configuration.neighbourhood import Neighbourhood
from mapping.inference.configuration.proposals import JOIN, PROPOSALS, REMOVE, Parts, Proposal

# Details that are weighed at once (see `account`), and places that they are usually weighed on: one fit of them takes
# about one CPU second. Its time grows with the square of the details (rows of a difference quotient times shapes) and
# with the places.
CROWDED, CROWDED_PLACES = 10, 1000
# Configurations that are fitted in one neighbourhood, of so many details each; of more, fewer: a bound on the time. The
# benches' plates and the shipped scenes have 5 details at most: twice as many, for what is proposed beside them, are
# not bounded any earlier.
MOST_FITTED = 40
# So many fits a detail are tried where nothing improves them: of the blocks of a page of braille, searched without a
# bound, those of two domes took 26, of three 41 and 42, of four 62
FITS_OF_DETAIL = 16
# Of such fits so many a detail are spent on joining pieces of a line, beyond them: 40 of 10 details, and 80 of 5, which
# is every pair of them and every pair that is left after that. With both, less than 10 CPU s a detail: 2.9 where 39
# details and 112 crossings felt each other, 6 in a row of twelve touching wires
MOST_JOINED = 4.0
# Share of its cost that a fit takes which is given up as hopeless: 0.05 of 0.3 CPU s in the median of 48 about a groove
GIVEN_UP_SHARE = 0.2
# A proposal must be better by this log odds: less is rounding, or the same configuration found again
WORTH = 0.5
# What is less likely than the best by this log odds is not gone on from, nor told
NEGLIGIBLE_ODDS = 7.0


@dataclass(frozen=True, eq=False)
class Account:
    """What a search found.

    Args:
        start: what the rules say.
        best: the configuration of the highest odds.
        visited: the best of each set of kinds, the best of all first.
        accepted: names of the proposals that led from the beginning to the best.
        bounded: True if the search ended at MOST_FITTED or MOST_JOINED, with proposals left.
    """

    start: Configuration
    best: Configuration
    visited: tuple[Configuration, ...]
    accepted: tuple[str, ...]
    bounded: bool = False

    @property
    def shares(self) -> list[tuple[tuple[str, ...], float]]:
        """Probability of each set of kinds among those that were visited, the largest first."""
        odds = np.array([each.log_odds for each in self.visited])
        weights = np.exp(odds - odds.max())
        return [(each.kinds, float(w)) for each, w in zip(self.visited, weights / weights.sum(), strict=True)]


def searched(
    start: Configuration, parts: Sequence[Part], points: FloatArray, proposals: Sequence[Proposal] = PROPOSALS
) -> Account:
    """Improve a configuration until no proposal does.

    Args:
        start: what the rules say, fitted.
        parts: the same, as the rules left it.
        points: (M, 3) of crests in the neighbourhood, m.
        proposals: the generators that are asked, in order.
    """
    place, best, accepted, idle = start.place, start, list[str](), 0
    left, bounded = MOST_FITTED - _cost(parts, place), False
    visited = {start.kinds: start}
    if REMOVE in proposals:
        # what the others explain as well is no piece of anything; these trials cost less than any other
        best, kept = _without_idle(start)
        if best is not start:
            parts = [parts[k] for k in kept]
            visited[best.kinds] = best
            accepted.append(REMOVE.name)
    whole, joining, joins = laid(parts, place), True, MOST_JOINED * len(parts)
    # pieces of one line hide each other once they are fitted: they are joined as the rules left them, those first that
    # gain most by it: both flanks of a wide line may be one step to some extent, and no longer a line after that
    while joining and left > 0.0:
        joining = False
        for other_parts in _yielded(JOIN, whole, points) if JOIN in proposals else ():
            if joins <= 0.0:
                bounded = True
                break
            other = fitted(other_parts, place)
            left, joins = left - _cost(other_parts, place), joins - _work(other_parts, place)
            if other is not None and other.log_odds > best.log_odds + WORTH:
                best, joined, joining = other, laid(other_parts, place), True
        if joining:
            whole = joined
            visited[best.kinds] = best
            accepted.append(JOIN.name)
    while idle < len(proposals):
        for proposal in proposals:
            found = best
            for proposed in _yielded(proposal, best, points):
                if left <= 0.0 and proposal is not REMOVE:  # what does not pay for itself goes, however many there are
                    bounded = True
                    break
                other = fitted(proposed, best.place, best)
                left -= _cost(proposed, best.place) * (GIVEN_UP_SHARE if other is None else 1.0)
                if other is None:
                    continue
                known = visited.get(other.kinds)
                if known is None or other.log_odds > known.log_odds:
                    visited[other.kinds] = other
                if other.log_odds > found.log_odds + WORTH:
                    found = other
            idle = 0 if found is not best else idle + 1
            if found is not best:
                best = found
                accepted.append(proposal.name)
            if idle == len(proposals):
                break
    order = sorted(visited.values(), key=lambda each: -each.log_odds)
    likely = [each for each in order if each.log_odds > order[0].log_odds - NEGLIGIBLE_ODDS]
    return Account(start, order[0], tuple(likely), tuple(accepted), bounded)


def _without_idle(start: Configuration) -> tuple[Configuration, list[int]]:
    """The configuration without the parts that do not pay for themselves, the idlest first, and who is left."""
    best, kept = start, list(range(len(start.parts)))
    while True:
        trials = [fitted([*best.parts[:k], *best.parts[k + 1 :]], best.place, best) for k in range(len(best.parts))]
        odds = [-np.inf if trial is None else trial.log_odds for trial in trials]
        idlest = int(np.argmax(odds)) if odds else 0
        other = trials[idlest] if odds else None
        if other is None or odds[idlest] <= best.log_odds + WORTH:
            return best, kept
        best, kept = other, [*kept[:idlest], *kept[idlest + 1 :]]


def _cost(parts: Sequence[Part], place: Neighbourhood) -> float:
    """What fitting a configuration takes of MOST_FITTED: its work, or its share of the fits of so many details."""
    return max(min(1.0, MOST_FITTED / (FITS_OF_DETAIL * max(len(parts), 1))), _work(parts, place))


def _work(parts: Sequence[Part], place: Neighbourhood) -> float:
    """Of fitting a configuration, in those of CROWDED details on CROWDED_PLACES."""
    rows, shapes = len(parts) / CROWDED, (len(parts) + len(place.held)) / CROWDED
    return rows * shapes * len(place.window) / CROWDED_PLACES


def _yielded(proposal: Proposal, now: Configuration, points: FloatArray) -> Iterator[Parts]:
    """What a proposal yields, up to what the base has no room for."""
    parts = proposal.of(now, points)
    while True:
        try:
            yield next(parts)
        except StopIteration:
            return
        except MappingError:
            return
