"""Search: from what the rules propose to the configuration with the highest odds, by accepted proposals alone."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from operator import attrgetter

import numpy as np

from mapping import FloatArray, MappingError
from mapping.inference.configuration.configuration import Configuration, Part, fitted, laid
from mapping.inference.configuration.neighbourhood import Neighbourhood
from mapping.inference.configuration.proposals import (
    JOIN,
    ONE_COURSE,
    PROPOSALS,
    REMOVE,
    RETELL,
    SMOOTHER,
    Parts,
    Proposal,
)

# Details that are weighed at once, each of so many parameters, and places that so many are weighed on (see `account`):
# one fit of them takes one to two CPU seconds. Its time grows with the places, and with the parameters, each of which
# is a row of a difference quotient, and what is held beside: 28 to 43 us for each row and place in fits of 1 to 10
# details with 7 to 70 parameters on 1,100 to 20,500 places
CROWDED, CROWDED_PARAMETERS, CROWDED_PLACES = 10, 6, 1000
# Configurations that are fitted in one neighbourhood, of so many details each; of more, fewer: a bound on the time. The
# benches' plates and the shipped scenes have 5 details at most: twice as many, for what is proposed beside them, are
# not bounded any earlier.
MOST_FITTED = 40
# So many fits a detail are tried where nothing improves them: of the blocks of a page of braille, searched without a
# bound, those of two domes took 26, of three 41 and 42, of four 62
FITS_OF_DETAIL = 16
# Work that is spent on each detail, in fits of a crowd: about half of the 10 CPU s that a feature may take, for each of
# these takes 0.3 to 0.9 where most fits are given up early (1 to 5 details of a coin on 900 to 3,300 places). What does
# not pay for itself is sought with as much again
MOST_WORK = 6.0
# Share of its cost that a fit takes which is given up as hopeless: 0.05 of 0.3 CPU s in the median of 48 about a groove
GIVEN_UP_SHARE = 0.2
# What costs least, and what the others would be asked twice without: a section is asked on the course that is likeliest
FIRST = (REMOVE, SMOOTHER)
# A proposal must be better by this log odds: less is rounding, or the same configuration found again
WORTH = 0.5
# What is less likely than the best by this log odds is not gone on from, nor told
NEGLIGIBLE_ODDS = 7.0
# What decides which configuration is told, and how probable each is said to be
TOLD_BY, STATED_BY = attrgetter("log_odds"), attrgetter("log_probability")


@dataclass(frozen=True, eq=False)
class Account:
    """What a search found.

    Args:
        start: what the rules say.
        best: the last configuration that was accepted: none that was visited is better by more than rounding.
        visited: the best of each set of kinds, of so many parts, the most probable first.
        accepted: names of the proposals that led from the beginning to the best.
        path: what each of them led to.
        bounded: True if the search ended at MOST_FITTED or MOST_WORK, with proposals left.
    """

    start: Configuration
    best: Configuration
    visited: tuple[Configuration, ...]
    accepted: tuple[str, ...]
    path: tuple[Configuration, ...]
    bounded: bool = False

    @property
    def plainest(self) -> Configuration:
        """The one of the fewest details that the search came through, the last of these."""
        return min((self.start, *self.path)[::-1], key=lambda each: len(each.kinds))

    @property
    def shares(self) -> list[tuple[tuple[str, ...], float]]:
        """Probability of each set of kinds among those that were visited, the largest first."""
        odds = np.array([each.log_probability for each in self.visited])
        weights = np.exp(odds - odds.max())
        shares = dict.fromkeys((each.kinds for each in self.visited), 0.0)
        for each, weight in zip(self.visited, weights / weights.sum(), strict=True):
            shares[each.kinds] += float(weight)
        return sorted(shares.items(), key=lambda each: -each[1])


def searched(
    start: Configuration, parts: Sequence[Part], points: FloatArray, proposals: Sequence[Proposal] = PROPOSALS
) -> Account:
    """Improve a configuration until no proposal does.

    Args:
        start: what the rules say, fitted.
        parts: the same, as the rules left it.
        points: (M, 3) of crests in the neighbourhood, m.
        proposals: the generators that are asked in turn, those of FIRST again after each improvement.
    """
    place, best = start.place, start
    search = _Search(points, proposals, _Spent(len(parts)))
    spent = search.spent
    spent.on(parts, place)
    search.note(start)
    if REMOVE in proposals:
        # what the others explain as well is no piece of anything; these trials cost less than any other
        best, kept, search.bounded = _without_idle(start, spent)
        if best is not start:
            parts = [parts[k] for k in kept]
            search.note(best)
            search.accept(REMOVE, best)
    whole, joining, joiners = laid(parts, place), True, [each for each in (ONE_COURSE, JOIN) if each in proposals]
    # pieces of one line hide each other once they are fitted: they are joined as the rules left them, those first that
    # gain most by it: both flanks of a wide line may be one step to some extent, and no longer a line after that. Where
    # all pieces are one course that leaves no more than noise no pairs of them are tried. Nothing hides a single piece:
    # whether it returns is asked when its section was
    while joining and len(whole.parts) > 1 and not spent.enough:
        joining = False
        for proposal in joiners:
            if joining and len(best.parts) == 1 and best.fits:
                break
            for other_parts in _yielded(proposal, whole, points):
                if spent.all_work:
                    search.bounded = True
                    break
                # a closed course begins far from where it fits: of few courses none is given up
                rival = best if proposal is JOIN else None
                other = fitted(other_parts, place, rival, anew=True)
                spent.on(other_parts, place, GIVEN_UP_SHARE if other is None and rival else 1.0)
                if other is not None and other.log_odds > best.log_odds + WORTH:
                    best, joined, joining, joiner = other, laid(other_parts, place), True, proposal
        if joining:
            whole = joined
            search.note(best)
            search.accept(joiner, best)
    best = search.climbed(best, TOLD_BY)
    to_told = len(search.accepted)
    # what is probable where the log bears so many details is no proof of one more: the search goes on from there for
    # what may be stated, and returns if that leads to what is told
    while True:
        probable = max(search.visited.values(), key=STATED_BY)
        if probable.log_probability > best.log_probability + WORTH:
            spent.fits = 0.0
            search.climbed(probable, STATED_BY)
        told = max(search.visited.values(), key=TOLD_BY)
        if told.log_odds <= best.log_odds + WORTH:
            break
        best, to_told = search.climbed(told, TOLD_BY), len(search.accepted)
    order = sorted(search.visited.values(), key=lambda each: -each.log_probability)
    least = min(order[0].log_probability - NEGLIGIBLE_ODDS, best.log_probability)
    likely = [each for each in order if each.log_probability >= least]
    accepted, path = tuple(search.accepted[:to_told]), tuple(search.path[:to_told])
    return Account(start, best, tuple(likely), accepted, path, search.bounded)


@dataclass(eq=False)
class _Search:
    """A search on its way.

    Args:
        points: (M, 3) of crests in the neighbourhood, m.
        proposals: the generators that are asked in turn, those of FIRST again after each improvement.
        spent: what it has taken by now.
        visited: the best of each set of kinds, of so many parts.
        accepted: names of the proposals that led to the best.
        path: what each of them led to.
        bounded: True if it ended with proposals left.
        asked: how often each proposal had its turn, by name.
    """

    points: FloatArray
    proposals: Sequence[Proposal]
    spent: _Spent
    visited: dict[tuple[tuple[str, ...], int], Configuration] = field(default_factory=dict)
    accepted: list[str] = field(default_factory=list)
    path: list[Configuration] = field(default_factory=list)
    bounded: bool = False
    asked: Counter[str] = field(default_factory=Counter)

    def note(self, other: Configuration) -> None:
        """One more was visited."""
        known = self.visited.get((other.kinds, len(other.parts)))
        if known is None or other.log_odds > known.log_odds:
            self.visited[other.kinds, len(other.parts)] = other

    def accept(self, proposal: Proposal, best: Configuration) -> None:
        """What a proposal led to is the best by now."""
        self.accepted.append(proposal.name)
        self.path.append(best)

    def climbed(self, best: Configuration, by: Callable[[Configuration], float]) -> Configuration:
        """A configuration improved by proposals until none is better by what is given."""
        first = [each for each in self.proposals if each in FIRST]
        others = [each for each in self.proposals if each not in FIRST]
        waiting, idle, turn = list(first), 0, itertools.cycle(others)
        while waiting or idle < len(others):
            if not waiting:
                idle += 1
            proposal = waiting.pop(0) if waiting else next(turn)
            self.asked[proposal.name] += 1
            found, partly = self._better(best, proposal, best, by)
            if found is best and partly is not None and not best.fits:  # what that leaves is told anew once more
                found, _ = self._better(best, proposal, partly, by)
            if found is not best:
                explains, best, waiting, idle = found.fits and not best.fits, found, list(first), 0
                self.accept(proposal, best)
                if proposal is RETELL or explains:  # from there the search begins anew
                    self.spent.fits, self.bounded = 0.0, False
        return best

    def _better(
        self, best: Configuration, proposal: Proposal, begun: Configuration, by: Callable[[Configuration], float]
    ) -> tuple[Configuration, Configuration | None]:
        """The best that a proposal makes of a configuration, or what was the best before; and of what is told anew and
        leaves more than noise the best."""
        found, spent = best, self.spent
        partly: Configuration | None = None
        for proposed in _yielded(proposal, begun, self.points):
            if self._ends(proposal, best):
                self.bounded = True
                break
            other = fitted(proposed, best.place, best)
            spent.on(proposed, best.place, GIVEN_UP_SHARE if other is None else 1.0)
            if other is None or _is_nothing_by_misfit(other):
                continue
            # crests beside crests hide what has another form: what is told anew leaves nothing, or is none
            if proposal is RETELL and not other.fits:
                partly = other if partly is None or by(other) > by(partly) else partly
                continue
            self.note(other)
            if by(other) > by(found) + WORTH:
                found = other
                if proposal is RETELL and found.is_explained:  # the other answers seemed less likely
                    break
        return found, partly

    def _ends(self, proposal: Proposal, best: Configuration) -> bool:
        """True if no more of a proposal is tried. What does not pay for itself goes, and what is left over is told
        anew, however many there are; no proposal stays unasked because others were asked often, or while something
        is left to explain."""
        if proposal in (REMOVE, RETELL):
            return self.spent.too_much
        return self.spent.enough if best.fits and self.asked[proposal.name] > 1 else self.spent.all_work


@dataclass(eq=False)
class _Spent:
    """What a search has taken by now.

    Args:
        details: that it began with.
        fits: configurations that were fitted, those of many details counting for more than one.
        work: of fitting them, in fits of a crowd.
    """

    details: int
    fits: float = 0.0
    work: float = 0.0

    def on(self, parts: Sequence[Part], place: Neighbourhood, share: float = 1.0) -> None:
        """One more is fitted, or so much of it."""
        own = _work(parts, place)
        self.work += share * own
        self.fits += share * max(min(1.0, MOST_FITTED / (FITS_OF_DETAIL * max(len(parts), 1))), own)

    @property
    def all_work(self) -> bool:
        """True if the work that may be spent is."""
        return self.work >= MOST_WORK * max(self.details, 1)

    @property
    def enough(self) -> bool:
        """True if nothing more is proposed."""
        return self.fits >= MOST_FITTED or self.all_work

    @property
    def too_much(self) -> bool:
        """True if not even what does not pay for itself is sought."""
        return self.work >= 2.0 * MOST_WORK * max(self.details, 1)


def _work(parts: Sequence[Part], place: Neighbourhood) -> float:
    """Of fitting a configuration, in fits of a crowd."""
    return work_of(sum(len(part.start) for part in parts) + len(place.held), len(place.window))


def work_of(rows: int, places: int) -> float:
    """Of fitting what has so many parameters, or details held beside them, on so many places, in fits of a crowd."""
    return rows * places / (CROWDED * CROWDED_PARAMETERS * CROWDED_PLACES)


def _without_idle(start: Configuration, spent: _Spent) -> tuple[Configuration, list[int], bool]:
    """The configuration without the parts that do not pay for themselves, the idlest first, who is left, and whether
    that ended before all was tried."""
    best, kept = start, list(range(len(start.parts)))
    while not spent.all_work:
        trials = list[Configuration | None]()
        for k in range(len(best.parts)):
            rest = [*best.parts[:k], *best.parts[k + 1 :]]
            trials.append(fitted(rest, best.place, best))
            spent.work += (GIVEN_UP_SHARE if trials[-1] is None else 1.0) * _work(rest, best.place)
        odds = [-np.inf if trial is None or _is_nothing_by_misfit(trial) else trial.log_odds for trial in trials]
        idlest = int(np.argmax(odds)) if odds else 0
        other = trials[idlest] if odds else None
        if other is None or odds[idlest] <= best.log_odds + WORTH:
            return best, kept, False
        best, kept = other, [*kept[:idlest], *kept[idlest + 1 :]]
    return best, kept, True


def _is_nothing_by_misfit(other: Configuration) -> bool:
    """True of nothing where more than noise was felt: misfit is of a shape, and nothing has none that may be wrong."""
    return not other.parts and not other.place.held and not other.fits


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
