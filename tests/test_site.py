"""The site: every document and every public name, built without a warning, and links that lead somewhere."""

from __future__ import annotations

import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from urllib.parse import unquote

import pytest

pytest.importorskip("sphinx")
ROOT = Path(__file__).resolve().parents[1]
ASKED_FOR = re.compile(r"""<(?:script|img|link)\b[^>]*?\b(?:src|href)=["']([^"']+)""")
LINK = re.compile(r"""<a\b[^>]*?\bhref=["']([^"']+)""")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    words = [sys.executable, str(ROOT / "docs" / "build_site.py"), str(folder)]
    done = subprocess.run(words, capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return folder


@pytest.mark.slow
def test_every_public_name_of_the_front_doors_has_its_place(site: Path) -> None:
    for door in ("explore3d", "mapping", "planners", "hw"):
        page = (site / "api" / f"{door}.html").read_text("utf-8")
        for name in import_module(door).__all__:
            # a constant that two rooms give is shown in both, anything else in one, and linked from the other
            assert f"{door}.{name}" in page or f">{name}<" in page, f"{door}.{name}"


@pytest.mark.slow
def test_no_link_of_the_site_leads_nowhere_and_no_page_asks_a_stranger(site: Path) -> None:
    places = {page: set(re.findall(r'\bid="([^"]+)"', page.read_text("utf-8"))) for page in site.rglob("*.html")}
    assert len(places) > 60
    broken = []
    for page in places:
        text = page.read_text("utf-8")
        assert not [each for each in ASKED_FOR.findall(text) if re.match(r"\w+:|//", each)]
        for link in LINK.findall(text):
            address, _, place = unquote(link).partition("#")
            if re.match(r"[a-z]+:", address):
                continue  # a reader may go there
            target = (page.parent / address).resolve() if address else page
            if not target.exists() or (place and target in places and place not in places[target]):
                broken.append(f"{page.relative_to(site)} -> {link}")
    assert not broken
