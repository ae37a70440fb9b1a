"""The search asks what costs least first, and gives up what no optimum can make useful."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mapping.inference.configuration import search
from mapping.inference.configuration.account import _not_of_misfit
from mapping.inference.configuration.configuration import HOPELESS, Configuration
from mapping.inference.configuration.neighbourhood import Neighbourhood
from mapping.inference.configuration.proposals import Proposal
from mapping.inference.sampler import Laplace

PLACE: Any = SimpleNamespace(levels=[None], window=range(10), held=())
DETAIL: Any = SimpleNamespace(start=np.zeros(1))


def found(parts: list[Any], gain: float, company: float = 0.0, details: int = 0) -> Any:
    """A configuration that each detail makes likelier by so much, and more probable by more; of fewer details than
    there are it does not fit."""
    odds = [each * len(parts) for each in (gain, gain + company)]
    kinds = ("ridge",) * len(parts)
    fits = len(parts) >= details
    return SimpleNamespace(parts=parts, place=PLACE, kinds=kinds, log_odds=odds[0], log_probability=odds[1], fits=fits)


def more(now: Any, points: Any) -> Iterator[list[Any]]:
    """Up to two details."""
    if len(now.parts) < 2:
        yield [*now.parts, DETAIL]


def searched(monkeypatch: pytest.MonkeyPatch, gain: float, company: float = 0.0) -> tuple[search.Account, list[str]]:
    """What a search finds by a cheap proposal, one more detail, and another, and what was asked in turn."""
    asked = []

    def noted(name: str, of: Any) -> Proposal:
        def generator(now: Any, points: Any) -> Iterator[list[Any]]:
            asked.append(name)
            yield from of(now, points)

        return Proposal(name, generator)

    monkeypatch.setattr(search, "fitted", lambda parts, place, rival=None, anew=False: found(parts, gain, company))
    cheap, other = (noted(name, lambda now, points: iter(())) for name in ("cheap", "other"))
    proposals = [cheap, noted("more", more), other]
    monkeypatch.setattr(search, "FIRST", (cheap,))
    return search.searched(found([], gain, company), [], np.zeros((0, 3)), proposals), asked


def test_what_costs_least_is_asked_again_after_each_improvement(monkeypatch: pytest.MonkeyPatch) -> None:
    account, asked = searched(monkeypatch, 2.0)
    assert asked == ["cheap", "more", "cheap", "other", "more", "cheap", "other", "more"]
    assert account.accepted == ("more", "more") and account.best.log_odds == 4.0 and not account.bounded


def test_what_is_better_by_less_than_counts_is_weighed_but_not_told(monkeypatch: pytest.MonkeyPatch) -> None:
    account, _ = searched(monkeypatch, 0.3)
    assert account.best is account.start and len(account.visited) == 2


def test_no_proposal_stays_unasked_because_another_was_asked_often(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(search, "fitted", lambda parts, place, rival=None, anew=False: found(parts, 2.0))
    monkeypatch.setattr(search, "FIRST", ())
    often = Proposal("often", lambda now, points: iter([[]] * (search.MOST_FITTED + 1)))
    account = search.searched(found([], 2.0), [], np.zeros((0, 3)), [often, Proposal("more", more)])
    assert len(account.best.parts) == 1 and account.bounded  # the second detail would be asked for once more


def test_the_search_goes_on_while_something_is_left_to_explain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(search, "FIRST", ())
    often = Proposal("often", lambda now, points: iter([[]] * (search.MOST_FITTED + 1)))
    for details, told in ((0, 1), (2, 2)):
        monkeypatch.setattr(
            search, "fitted", lambda parts, place, rival=None, anew=False, n=details: found(parts, 2.0, 0.0, n)
        )
        start = found([], 2.0, 0.0, details)
        account = search.searched(start, [], np.zeros((0, 3)), [often, Proposal("more", more)])
        assert len(account.best.parts) == told


def test_what_was_felt_is_not_taken_for_nothing_because_its_shape_misfits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(search, "FIRST", (search.REMOVE,))
    for details, left in ((0, 0), (2, 1)):  # nothing leaves no more than noise, or does
        monkeypatch.setattr(
            search, "fitted", lambda parts, place, rival=None, anew=False, n=details: found(parts, -2.0, 0.0, n)
        )
        start = found([DETAIL], -2.0, 0.0, details)
        account = search.searched(start, [DETAIL], np.zeros((0, 3)), [search.REMOVE])
        assert len(account.best.parts) == left


def test_a_single_piece_is_asked_whether_it_returns_when_its_section_was(monkeypatch: pytest.MonkeyPatch) -> None:
    for pieces, first in ((1, "section"), (2, "one course")):
        asked: list[str] = []

        def noted(name: str, asked: list[str] = asked) -> Proposal:
            return Proposal(name, lambda now, points: iter(asked.append(name) or ()))  # type: ignore[func-returns-value]

        section, course = noted("section"), noted("one course")
        monkeypatch.setattr(search, "FIRST", (section,))
        monkeypatch.setattr(search, "ONE_COURSE", course)
        monkeypatch.setattr(search, "laid", lambda parts, place: found(parts, 2.0))
        parts = [DETAIL] * pieces
        search.searched(found(parts, 2.0), parts, np.zeros((0, 3)), [section, course])
        assert asked[0] == first and len(asked) > 1


def test_what_is_probable_beside_others_is_stated_and_not_told(monkeypatch: pytest.MonkeyPatch) -> None:
    account, _ = searched(monkeypatch, -2.0, 4.0)
    assert account.best is account.start and account.accepted == ()
    weights = np.exp([4.0, 2.0, 0.0]) / np.exp([4.0, 2.0, 0.0]).sum()
    assert [len(kinds) for kinds, _ in account.shares] == [2, 1, 0]
    np.testing.assert_allclose([share for _, share in account.shares], weights)


def test_details_that_were_added_on_the_way_pay_beside_the_misfit_or_are_not_told() -> None:
    """One groove that stands for three pieces leaves more than noise, of which a pit explains little or much."""
    place: Any = SimpleNamespace(window=SimpleNamespace(half=np.full(1000, 0.2e-3)), half_width=1.3e-3)

    def left(kinds: tuple[str, ...], square: float) -> Any:
        white, prior = np.full(1000, np.sqrt(square)), -8.0 * len(kinds)
        fitted = SimpleNamespace(mean=np.zeros(4 * len(kinds)))
        return SimpleNamespace(kinds=kinds, place=place, white_residual=white, log_prior=prior, found=fitted)

    pieces, whole, pit = left(("groove",) * 3, 3.6), left(("groove",), 1.9), ("groove", "pit")
    for square, told in ((1.8, whole.kinds), (1.2, pit)):
        best = left(pit, square)
        account = search.Account(pieces, best, (), ("one course", "add"), (whole, best))
        assert account.plainest is whole and _not_of_misfit(account).kinds == told


def test_details_are_as_probable_as_the_log_shows_others() -> None:
    place: Any = SimpleNamespace(elsewhere=0, path=2.0, false_alarms_per_metre=0.01)
    company = [Neighbourhood.log_company(place, details) for details in (0, 1, 2, 3)]
    assert company == pytest.approx([0.0, 0.0, np.log(50.0), np.log(50.0) + np.log(100.0)])
    place.elsewhere = 3
    assert Neighbourhood.log_company(place, 1) == pytest.approx(np.log(150.0))


def test_what_has_fewer_parameters_may_be_less_likely_at_its_best() -> None:
    likelihood: Any = SimpleNamespace(log_density=lambda templates: np.array([900.0]))
    place: Any = SimpleNamespace(levels=[(likelihood, 0.0)])
    rival = Configuration((), place, Laplace(np.zeros(20), np.eye(20), 1000.0), 0, 800.0, Any)  # type: ignore[arg-type]
    rival.__dict__["template"] = np.zeros(3)
    assert rival.hopeless(20, 0) == rival.hopeless(30, 0) == 900.0 - HOPELESS
    assert rival.hopeless(5, 0) == pytest.approx(900.0 - 0.75 * 100.0 - HOPELESS)
