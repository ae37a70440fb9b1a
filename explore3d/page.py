"""Page: a self-contained HTML page in the report's style, for benches and tables."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version

from explore3d import __version__
from explore3d.markup import Html, element, section, table
from explore3d.report_style import STYLE

POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
PACKAGES = ("numpy", "scipy", "numba", "libigl", "open3d-cpu", "open3d", "emcee", "opencamlib", "pymeshlab")
MORE_STYLE = (
    ".table { max-height: none; } td { min-width: 5rem; } td b, td small, td span { white-space: normal; }"
    " td.number, .badge { white-space: nowrap; }"
)


def page(kind: str, title: str, lead: str, *sections: str) -> str:
    """The whole page; it loads nothing."""
    header = element(
        "header", element("p", kind, class_="kind"), element("h1", title), element("p", lead, class_="lead")
    )
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"{element('title', title + ' · explore3d')}<style>{STYLE}{MORE_STYLE}</style></head>"
        f"<body>{element('main', header, *sections)}</body></html>\n"
    )


def machine() -> dict[str, str]:
    """What the figures were measured on: processor, system, versions."""
    import os

    facts = {
        "processor": _processor(),
        "cores": str(os.cpu_count()),
        "system": f"{platform.system()} {platform.release()}",
        "Python": platform.python_version(),
        "explore3d": __version__,
    }
    for package in PACKAGES:
        try:
            facts[package] = version(package)
        except PackageNotFoundError:
            continue
    return facts


def machine_section(more: Sequence[tuple[str, str]] = ()) -> Html:
    """The machine as a section of a page."""
    rows = [*machine().items(), *more]
    return section("What it was measured on", "machine", table(("what", "which"), rows))


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            names = [line.split(":", 1)[1].strip() for line in file if line.startswith("model name")]
    except OSError:
        names = []
    return names[0] if names else platform.processor() or platform.machine()
