"""What is told of details that are felt together, in words, and read again: "one step and two ridges"."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from mapping import Feature
from mapping.inference.kinds import KINDS, kind_named

NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
NOTHING = "nothing"


def in_words(kinds: Sequence[str]) -> str:
    """Kinds of features as people count them: "one step and two ridges"."""
    parts = []
    for name, count in Counter(kinds).items():
        number = NUMBERS[count] if count < len(NUMBERS) else str(count)
        parts.append(f"{number} {name if count == 1 else kind_named(name).plural}")
    return " and ".join(parts) if parts else NOTHING


def numbers_in(words: str) -> Counter[str]:
    """How many details of each kind `in_words` speaks of."""
    kinds = {called: name for name in KINDS for called in (name, kind_named(name).plural)}
    found: Counter[str] = Counter()
    for part in words.split(" and ") if words != NOTHING else ():
        number, called = part.split(" ", 1)
        found[kinds[called]] += NUMBERS.index(number) if number in NUMBERS else int(number)
    return found


def share_as_told(feature: Feature) -> float:
    """Probability that, if anything is there, there are as many of a feature's kind as its model has, 0 to 1.

    Of what the account of its neighbourhood says that this may be, the first is what the model has. A feature that is
    there in one number only is as probable as that number; whether there is anything at all its log odds say.
    """
    account = [(numbers_in(words), share) for words, share in feature.details.account or () if words != NOTHING]
    if not account:
        return 1.0
    told = account[0][0][feature.kind]
    return sum(share for numbers, share in account if numbers[feature.kind] == told) / sum(
        share for _, share in account
    )
