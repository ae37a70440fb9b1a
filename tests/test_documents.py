"""The documents lead somewhere: links, named places, the version and the picture of the rooms."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path

import pytest

from explore3d import __version__

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")])
LINK = re.compile(r"(?<!\\)\]\(([^)\s]+)\)")
PLACE = re.compile(r"`((?:mapping|hw|planners|explore3d|tests|docs|assets)/[\w/.*]*)`")


def prose(page: Path) -> str:
    """A page's text without its blocks of code."""
    return re.sub(r"^```.*?^```$", "", page.read_text("utf-8"), flags=re.MULTILINE | re.DOTALL)


def anchors(page: Path) -> set[str]:
    """What a link may name behind the hash, as GitHub makes it from the headings."""
    headings = re.findall(r"^#+ (.+)$", prose(page), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_between_the_documents_leads_somewhere(page: Path) -> None:
    for link in LINK.findall(prose(page)):
        if re.match(r"[a-z]+:", link):
            continue  # to the outside
        name, _, anchor = link.partition("#")
        target = (page.parent / name).resolve() if name else page
        assert target.exists(), f"{page.name} links to {link}"
        assert not anchor or anchor in anchors(target), f"{page.name} links to {link}; there are {anchors(target)}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_place_that_a_document_names_exists(page: Path) -> None:
    if page.name == "CHANGELOG.md":
        return  # it names what has gone
    missing = [place for place in PLACE.findall(prose(page)) if not any(ROOT.glob(place.rstrip("/")))]
    assert not missing


def test_the_readme_opens_with_a_picture_of_a_result() -> None:
    picture = LINK.search((ROOT / "README.md").read_text("utf-8"))
    assert picture and picture[1].endswith(".png")
    assert (ROOT / picture[1]).stat().st_size < 200_000


def test_the_changelog_begins_with_this_version() -> None:
    versions = re.findall(r"^## (\S+)$", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.MULTILINE)
    assert next(each for each in versions if each != "Unreleased") == __version__


def test_the_rooms_are_drawn_without_a_circle() -> None:
    spec = importlib.util.spec_from_file_location("draw_architecture", ROOT / "docs" / "draw_architecture.py")
    assert spec and spec.loader
    script = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = script
    spec.loader.exec_module(script)
    arrows = script.imports()
    floors = [room for package in script.PACKAGES for floor in script.floors(package, arrows) for room in floor]
    assert len(floors) == len(set(floors)) > 25
    order = {package: number for number, package in enumerate(script.PACKAGES)}
    assert all(order[a.split(".")[0]] >= order[b.split(".")[0]] for a, b in arrows)
