"""Markup: the few pieces of HTML that the report is made of; every text is escaped here."""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path

Row = Sequence[str]
# Units that a reader may choose, "": for each length the one that fits
READER_UNITS = {
    "": "fitting units",
    "m": "m",
    "mm": "mm",
    "µm": "µm",
    "nm": "nm",
    "in": "inches",
    "mil": "mil (0.001 in)",
}


# Columns that a telephone shows beside each other
MOST_NARROW_COLUMNS = 3


class Html(str):
    """Text that is markup already and is not escaped again."""


def text(value: str) -> Html:
    """The value as markup: escaped, unless it is markup."""
    return value if isinstance(value, Html) else Html(escape(value))


def element(name: str, *content: str, **attributes: str) -> Html:
    """`<name attributes>content</name>`; write class_ for class."""
    written = "".join(f' {key.rstrip("_").replace("_", "-")}="{escape(each)}"' for key, each in attributes.items())
    return Html(f"<{name}{written}>{''.join(text(each) for each in content)}</{name}>")


def paragraph(*content: str) -> Html:
    """A paragraph."""
    return element("p", *content)


def table(head: Row, rows: Iterable[Row], *, numeric: Sequence[int] = ()) -> Html:
    """A table, on narrow screens a card for each row if it has many columns; those in `numeric` are right-aligned.

    It can be scrolled by keyboard, so it can be reached by keyboard, and says what it is by its first column.
    """

    def cells(kind: str, row: Row, **labels: Sequence[str]) -> Html:
        made = []
        for i, each in enumerate(row):
            attributes = {"class_": "number"} if i in numeric else {}
            attributes |= {name: texts[i] for name, texts in labels.items() if each}
            made.append(element(kind if each else "td", each, **attributes))  # a header without a word is none
        return element("tr", *made)

    body = element("tbody", *(cells("td", row, data_label=head) for row in rows))
    whole = element("table", element("thead", cells("th", head)), body)
    wide = "table wide" if len(head) > MOST_NARROW_COLUMNS else "table"
    return element("div", whole, class_=wide, role="group", tabindex="0", aria_label=f"Table: {head[0]}")


def section(title: str, name: str, *content: str) -> Html:
    """A titled section that can be linked to as #name."""
    return element("section", element("h2", title), *content, id=name)


def contents(sections: Iterable[str]) -> Html:
    """Links to the sections among pieces of a page, in their order."""
    found = [
        (match["name"], match["title"])
        for each in sections
        if (match := re.match(r'<section id="(?P<name>[^"]*)"><h2>(?P<title>.*?)</h2>', each))
    ]
    links = [element("a", Html(title), href=f"#{name}") for name, title in found]
    return element("nav", *links, class_="contents", aria_label="Contents")


def folded(summary: str, name: str, *content: str) -> Html:
    """What is opened by a click, or by a link to #name."""
    return element("details", element("summary", summary), element("div", *content, id=name))


def figure(picture: bytes, description: str, caption: str) -> Html:
    """A picture inside the page, PNG or SVG, with its caption."""
    if picture.startswith(b"<svg"):
        name = f'<svg role="img" aria-label="{escape(description)}"'
        image = Html(picture.decode().replace("<svg", name, 1))
    else:
        source = "data:image/png;base64," + base64.b64encode(picture).decode("ascii")
        image = Html(f'<img src="{source}" alt="{escape(description)}">')
    return element("figure", image, element("figcaption", caption))


def script(code: str) -> Html:
    """Code that the page runs; it holds no text from outside."""
    return Html(f"<script>{code}</script>")


def data_script(name: str, document: object) -> Html:
    """Data for a script, as JSON in an element of that id: no text in it can end the element."""
    written = json.dumps(document, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    escaped = written.replace("<", "\\u003c")
    return Html(f'<script type="application/json" id="{escape(name)}">{escaped}</script>')


def choice_of_units() -> Html:
    """A list of units of length, for units_script."""
    names = [element("option", name, value=unit) for unit, name in READER_UNITS.items()]
    return element("p", element("label", "lengths in ", element("select", *names, id="unit")), class_="units")


def units_script() -> Html:
    """The code that writes the page's lengths in the unit that was chosen; stands behind all that it writes in."""
    return script("{\n" + Path(__file__).with_name("units.js").read_text(encoding="utf-8") + "}\n")


def badge(content: str, kind: str) -> Html:
    """A short remark on a coloured ground; kinds: good, bad, plain."""
    return element("span", content, class_=f"badge {kind}")
