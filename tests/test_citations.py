"""Who cites the theory finds what is cited: every section and equation named elsewhere stands in docs/theory.md."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[1]
THEORY = ROOT / "docs" / "theory.md"
PACKAGES = ("mapping", "hw", "planners", "explore3d")
# Fewer citations than this cannot be all: the collector no longer understands how they are written.
AT_LEAST = 35

NUMBER = r"\d+(?:\.\d+)*"
ONE = rf"(?:\({NUMBER}\)|{NUMBER})"
NUMBERS = rf"{ONE}(?:(?:\s*,\s*and\s+|\s*,\s*|\s+and\s+|\s+to\s+|\s*[-–]\s*){ONE})*"
UNIT = r"(?P<unit>sections?|equations?|eqs?\.)"
THE_THEORY = r"[\[`]?(?:docs/)?\btheory(?:\.md)?(?:`|\]\([^)\s]*\))?"
# "theory section 6", "theory.md, sections 3 and 6", "theory equation 4.2", "(theory, 6)"
NAMED_FIRST = re.compile(rf"{THE_THEORY}(?:,?\s+{UNIT}|,)\s+(?P<numbers>{NUMBERS})", re.IGNORECASE)
# "section 6 of the theory", "sections 3 and 6 of docs/theory.md"
NAMED_LAST = re.compile(rf"\b{UNIT}\s+(?P<numbers>{NUMBERS})\s+(?:of|in)\s+(?:the\s+)?{THE_THEORY}", re.IGNORECASE)
HEADING = re.compile(rf"^#+ ({NUMBER})\.? \S", re.MULTILINE)
# at the right border of a formula; in running text one space alone precedes a number
TAG = re.compile(rf"  \(({NUMBER})\)$", re.MULTILINE)


class Citation(NamedTuple):
    """A place, the words there, and what they cite: an equation if `equation`, else a section."""

    place: str
    words: str
    number: str
    equation: bool


def citations_in(text: str, place: str) -> Iterator[Citation]:
    """Every section and equation of the theory that a text cites; comments and docstrings may break lines."""
    # the same length as before, so that lines can be counted; hashes begin the next line of a comment
    flat = re.sub(r"\n[ \t]*#?", lambda found: " " * len(found[0]), text)
    for pattern in (NAMED_FIRST, NAMED_LAST):
        for found in pattern.finditer(flat):
            line = text.count("\n", 0, found.start()) + 1
            equation = (found["unit"] or "section").lower().startswith("eq")
            words = " ".join(found[0].split())
            for number in spelled_out(found["numbers"]):
                yield Citation(f"{place}:{line}", words, number, equation)


def spelled_out(numbers: str) -> list[str]:
    """Each number of a list such as "3, 4 and 6"; whole numbers between the ends of a range such as "3 to 6" too."""
    parts = re.split(r"\s*(\bto\b|[-–]|,|\band\b)\s*", re.sub(r"[()]", "", numbers))
    found = [parts[0]]
    for mark, number in zip(parts[1::2], parts[2::2], strict=True):
        if mark in ("to", "-", "–") and found[-1].isdigit() and number.isdigit():
            found += [str(k) for k in range(int(found[-1]) + 1, int(number))]
        found.append(number)
    return [number for number in found if number]


def sources() -> list[Path]:
    """All Python files of the four packages and of the tests, at any depth, and the documents."""
    folders = [ROOT / package for package in (*PACKAGES, "tests")]
    python = [path for folder in folders for path in folder.rglob("*.py") if path != Path(__file__).resolve()]
    return sorted([*python, *(path for path in (ROOT / "docs").glob("*.md") if path != THEORY)])


@cache
def citations() -> tuple[Citation, ...]:
    return tuple(
        citation
        for path in sources()
        for citation in citations_in(path.read_text(encoding="utf-8"), str(path.relative_to(ROOT)))
    )


@cache
def theory() -> str:
    return THEORY.read_text(encoding="utf-8")


def dangling(cited: tuple[Citation, ...], text: str) -> list[str]:
    """The citations that lead nowhere in a theory's text."""
    sections, equations = set(HEADING.findall(text)), set(TAG.findall(text))
    return [
        f"{c.place}: {c.words!r}: no {'equation' if c.equation else 'section'} {c.number}"
        for c in cited
        if c.number not in (equations if c.equation else sections)
    ]


def test_every_cited_section_and_equation_stands_in_the_theory() -> None:
    assert len(citations()) >= AT_LEAST, f"only {len(citations())} citations found: are they written otherwise now?"
    assert not dangling(citations(), theory())


def test_every_package_the_tests_and_the_documents_are_searched() -> None:
    assert {path.relative_to(ROOT).parts[0] for path in sources()} == {*PACKAGES, "tests", "docs"}
    assert len({citation.place.split("/")[0] for citation in citations()}) >= 4


def test_a_citation_that_leads_nowhere_is_told_with_its_place() -> None:
    cited = tuple(citations_in('"""Reference: theory sections 3 and 99."""\n# theory equation 4.77', "some.py"))
    assert dangling(cited, theory()) == [
        "some.py:1: 'theory sections 3 and 99': no section 99",
        "some.py:2: 'theory equation 4.77': no equation 4.77",
    ]


def test_without_its_headings_the_theory_answers_nothing() -> None:
    assert len(dangling(citations(), theory().replace("#", ""))) >= AT_LEAST


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("theory section 6: P = Phi(d' - u).", ["6"]),
        ("(theory section 6)", ["6"]),
        ("theory sections 3, 4 and 6.", ["3", "4", "6"]),
        ("docs/theory.md, section 4.2", ["4.2"]),
        ("theory.md section 6.1, and more", ["6.1"]),
        ("[theory](theory.md) section 4.2", ["4.2"]),
        ("[theory.md](theory.md), section 3", ["3"]),
        ("section 6 of the theory", ["6"]),
        ("see sections 3 and 6 of docs/theory.md", ["3", "6"]),
        ("(theory, 6)", ["6"]),
        ("theory sections 3 to 6", ["3", "4", "5", "6"]),
        ("# as wide as theory\n    # section 6 says", ["6"]),
        ("theory equations (4.2) and (4.4)", ["4.2", "4.4"]),
        ("the paper, section 3.3; theory section 6", ["6"]),
        ("paper section 2.2", []),
        ("Theory of Probability, appendix B", []),
        ("(theory: d' = 4.92, threshold 4.21)", []),
    ],
)
def test_citations_are_understood_however_they_are_written(text: str, numbers: list[str]) -> None:
    assert [citation.number for citation in citations_in(text, "some.py")] == numbers


def test_sections_and_equations_are_numbered_once_and_in_order() -> None:
    for found in (HEADING.findall(theory()), TAG.findall(theory())):
        keys = [tuple(int(part) for part in number.split(".")) for number in found]
        assert keys == sorted(set(keys))
