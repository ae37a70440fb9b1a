"""The examples of docs/extending.md run as they are printed."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

from mapping.inference.kinds.kind import KINDS

PAGE = Path(__file__).resolve().parents[1] / "docs" / "extending.md"
SECTIONS = {
    title: re.findall(r"^```python\n(.*?)^```$", body, re.MULTILINE | re.DOTALL)
    for title, body in re.findall(r"^## (.+?)\n(.*?)(?=^## |\Z)", PAGE.read_text("utf-8"), re.MULTILINE | re.DOTALL)
}


def test_everything_that_people_add_has_an_example() -> None:
    assert list(SECTIONS) == ["A finger", "A planner", "A base family", "A kind of feature"]
    assert all(len(blocks) >= 2 for blocks in SECTIONS.values())


@pytest.fixture(autouse=True)
def the_table_of_kinds_as_it_was() -> Iterator[None]:
    before = dict(KINDS)
    yield
    KINDS.clear()
    KINDS.update(before)


@pytest.mark.parametrize("title", SECTIONS)
def test_the_example_runs(title: str, monkeypatch: pytest.MonkeyPatch) -> None:
    module = ModuleType("example")
    monkeypatch.setitem(sys.modules, "example", module)  # dataclasses look their module up
    for block in SECTIONS[title]:
        exec(compile(block, f"{PAGE.name}: {title}", "exec"), module.__dict__)
