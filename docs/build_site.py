"""The documents and the reference of every public name, as a site: python docs/build_site.py [FOLDER], else out/site.

The pages are those of this folder and of the one above; the reference is made of the docstrings, room by room, each
name once: where it is met first on the way in from the front doors. Nothing is fetched, and the site fetches nothing.
A warning is an error: a link that leads nowhere, a docstring that cannot be read.
"""

from __future__ import annotations

import inspect
import pkgutil
import re
import shutil
import sys
import tempfile
from importlib import import_module
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx
from sphinx.util.console import nocolor
from sphinx.util.docutils import docutils_namespace

from explore3d import __version__

ROOT = Path(__file__).resolve().parents[1]
SITE = ROOT / "out" / "site"
FRONT_DOORS = ("explore3d", "mapping", "planners", "hw")
# Pages of the root that the site has beside those of this folder; the README is its first
ABOVE = {"README.md": "index.md", "CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}
BEGIN = ("examples", "scene", "log", "model", "watch", "display", "compare", "roughness", "batch", "hardware")
UNDERSTAND = ("glossary", "theory", "exploration", "detection", "posterior_calibration", "trust")
# What a reader looks for first
ORDER = ("function", "class", "data", "exception")
WORK = ("architecture", "extending", "contributing", "changelog")
SETTINGS = {
    "project": "explore3d",
    "version": __version__,
    "extensions": ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"],
    "html_theme": "furo",
    "html_title": f"explore3d {__version__}",
    "html_copy_source": False,
    "html_show_copyright": False,
    "highlight_language": "none",
    "myst_heading_anchors": 4,  # the documents link to headings as GitHub names them
    "autodoc_member_order": "bysource",
    "autodoc_default_options": {"members": True, "exclude-members": "model_config, model_post_init"},
    "autodoc_type_aliases": {name: name for name in ("FloatArray", "IntArray", "BoolArray", "Progress", "Record")},
    "python_use_unqualified_type_names": True,
    "add_module_names": False,
}


def main(site: Path) -> None:
    """Build the site in a folder. Ends with status 1 at the first warning."""
    nocolor()
    with tempfile.TemporaryDirectory(prefix="explore3d-site-") as folder:
        pages = Path(folder) / "pages"
        pages.mkdir()
        write_pages(pages)
        write_reference(pages / "api")
        with docutils_namespace():
            app = Sphinx(
                pages, None, site, Path(folder) / "trees", "html", SETTINGS, status=None, warningiserror=True
            )  # fmt: skip
            app.connect("autodoc-process-docstring", code_spans, priority=400)
            app.build()
            if app.statuscode:
                sys.exit(app.statuscode)
    print(f"site: {site / 'index.html'}")


# pages


def write_pages(pages: Path) -> None:
    """Every document, with what it shows and links to, in one folder."""
    for source in sorted((ROOT / "docs").iterdir()):
        if source.suffix in (".png", ".json"):
            shutil.copy(source, pages)
    shutil.copytree(ROOT / "examples", pages / "examples", ignore=shutil.ignore_patterns("__pycache__"))
    for source in sorted((ROOT / "docs").glob("*.md")):
        (pages / source.name).write_text(moved(source.read_text("utf-8")), "utf-8")
    for name, page in ABOVE.items():
        (pages / page).write_text(moved((ROOT / name).read_text("utf-8")), "utf-8")
    with (pages / "index.md").open("a", encoding="utf-8") as index:
        index.writelines(map(contents, ("Use", "Understand", "Work on it"), (BEGIN, UNDERSTAND, WORK)))
        index.write(contents("Reference", [f"api/{door}" for door in FRONT_DOORS]))


def moved(text: str) -> str:
    """A document whose links lead to where the site has what they name."""
    for name, page in ABOVE.items():
        text = re.sub(rf"\]\((?:\.\./)?{name}", f"]({page}", text)
    return re.sub(r"\]\((?:docs|\.\.)/", "](", text)


def contents(caption: str, pages: Any) -> str:
    """A part of the site's table of contents, in MyST."""
    return "\n".join(["", "```{toctree}", ":hidden:", f":caption: {caption}", "", *pages, "```", ""])


# reference


def write_reference(folder: Path) -> None:
    """A page for every room, and for each package one that lists its rooms."""
    folder.mkdir()
    seen: dict[int, str] = {}
    for door in FRONT_DOORS:
        package = import_module(door)
        inner = [each.name for each in pkgutil.walk_packages(package.__path__, f"{door}.") if each.ispkg]
        rooms = [each for each in inner if getattr(import_module(each), "__all__", ())]
        for room in (door, *rooms):
            tree = ["", ".. toctree::", "   :hidden:", "", *(f"   {each}" for each in rooms)] if room == door else []
            (folder / f"{room}.rst").write_text("\n".join([*room_page(room, seen), *tree, ""]), "utf-8")


def room_page(room: str, seen: dict[int, str]) -> list[str]:
    """The page of a room: what it is, and every name that its doorway gives, in reStructuredText.

    Args:
        room: full name of the package.
        seen: {identity of an object: its full name} of those that have their place already; this page's are added.
    """
    module = import_module(room)
    lines = [room, "=" * len(room), "", *_literal(inspect.getdoc(module) or "").splitlines(), ""]
    lines += [f".. py:module:: {room}", ""]
    again = []
    names = sorted(module.__all__, key=lambda name: ORDER.index(_kind(getattr(module, name))))
    for name in names:
        value, full = getattr(module, name), f"{room}.{name}"
        kind = _kind(value)
        if kind != "data" and id(value) in seen:
            again.append(f":py:obj:`{name} <{seen[id(value)]}>`")
            continue
        seen[id(value)] = full
        if kind == "data":
            shown = repr(value)
            lines += [f".. py:data:: {name}", *([f"   :value: {shown}"] if len(shown) < 80 else []), ""]
        else:
            lines += [f".. auto{kind}:: {full}", ""]
    return lines + (["From further out: " + ", ".join(again) + "."] if again else [])


def _kind(value: Any) -> str:
    if inspect.isclass(value):
        return "exception" if issubclass(value, BaseException) else "class"
    return "function" if inspect.isroutine(value) else "data"


def code_spans(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """A docstring as reStructuredText."""
    lines[:] = _literal("\n".join(lines)).split("\n")


def _literal(text: str) -> str:
    """Plain text with code as in Markdown: an indented block stays as it is, `code` gets two backticks."""
    parts = re.split(r"(?<=\n\n)((?: {4}.*(?:\n|$))+)", text)
    blocks = [f"::\n\n{part}\n" for part in parts[1::2]]
    return "".join(part for pair in zip(map(_spans, parts[::2]), [*blocks, ""], strict=True) for part in pair)


def _spans(text: str) -> str:
    """`code` in two backticks; what would be markup is not."""
    parts = re.split(r"(?<!`)`([^`]+)`(?!`)", text)
    plain = [re.sub(r"([*|\\]|_\b)", r"\\\1", part) for part in parts[::2]]
    code = [f"``{part}``" for part in parts[1::2]]
    return "".join(part for pair in zip(plain, [*code, ""], strict=True) for part in pair)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else SITE)
