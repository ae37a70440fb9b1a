"""Page: a self-contained HTML page in the report's style, for benches and tables."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version

from explore3d import __version__
from explore3d.report.markup import Html, element, section, table

PAGE_SECURITY_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
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
        f'<meta http-equiv="Content-Security-Policy" content="{PAGE_SECURITY_POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"{element('title', title + ' · explore3d')}<style>{REPORT_CSS}{MORE_STYLE}</style></head>"
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


REPORT_CSS = """
:root { color-scheme: light dark; --ink: #1f2933; --soft: #52606d; --faint: #e4e7eb; --paper: #ffffff; --wash: #f5f7fa;
  --link: #1d4e89; --edge: #9aa5b1; --chosen: #fff4cc; --warn: #fff8eb; --good: #e3f5ea; --good-ink: #14613c;
  --bad: #fdecea; --bad-ink: #9b1c1c; --plain: #eef1f4; --plain-ink: #3e4c59; }
* { box-sizing: border-box; }
body { margin: 0; background: var(--paper); color: var(--ink);
  font: 16px/1.55 system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; }
main { max-width: 1240px; margin: 0 auto; padding: 2.2rem 1.4rem 4rem; }
header .kind { color: var(--soft); font-size: .85rem; letter-spacing: .06em; text-transform: uppercase; margin: 0; }
h1 { font-size: 2rem; line-height: 1.2; margin: .2rem 0 .8rem; font-weight: 650; }
h2 { font-size: 1.25rem; margin: 0 0 .6rem; font-weight: 650; }
section { margin-top: 2.6rem; padding-top: 1.4rem; border-top: 1px solid var(--faint); }
p { margin: .5rem 0; max-width: 46rem; }
p.lead { font-size: 1.2rem; line-height: 1.5; max-width: 52rem; }
.warning { border-left: 4px solid #d97706; background: var(--warn); padding: .6rem .9rem; max-width: 52rem; }
.facts { display: flex; flex-wrap: wrap; gap: 1px; margin: 1.4rem 0 0; background: var(--faint);
  border: 1px solid var(--faint); border-radius: 8px; overflow: hidden; }
.facts div { background: var(--paper); padding: .7rem .9rem; flex: 1 1 150px; }
.facts b { display: block; font-size: 1.2rem; font-weight: 600; font-variant-numeric: tabular-nums; }
.facts span { color: var(--soft); font-size: .85rem; }
.table { overflow: auto; max-height: 34rem; margin: .8rem 0; border: 1px solid var(--faint); border-radius: 8px; }
table { border-collapse: collapse; width: 100%; font-size: .92rem; font-variant-numeric: tabular-nums; }
th { position: sticky; top: 0; background: var(--wash); text-align: left; font-weight: 600; color: var(--soft);
  white-space: nowrap; }
thead td { background: var(--wash); }
th, td { padding: .5rem .7rem; border-bottom: 1px solid var(--faint); vertical-align: top; }
tbody tr:last-child td { border-bottom: 0; }
td.number, th.number { text-align: right; white-space: nowrap; }
td b, td span, td small { white-space: nowrap; } td small.note { white-space: normal; min-width: 9rem; }
td small { display: block; color: var(--soft); font-size: .82rem; }
.badge { display: inline-block; padding: .05rem .5rem; border-radius: 999px; font-size: .82rem; white-space: nowrap; }
.badge.good { background: var(--good); color: var(--good-ink); }
.badge.bad { background: var(--bad); color: var(--bad-ink); }
.badge.plain { background: var(--plain); color: var(--plain-ink); }
.bar { display: inline-block; height: .7rem; background: #829ab1; border-radius: 2px; min-width: 1px; }
figure { margin: 1rem 0; }
figure > img, figure > svg { max-width: 100%; height: auto; display: block; border: 1px solid var(--faint);
  border-radius: 8px; }
figcaption { color: var(--soft); font-size: .9rem; margin-top: .45rem; max-width: 52rem; }
.view { border: 1px solid var(--faint); border-radius: 8px; overflow: hidden; }
.view .stage { position: relative; height: 560px; } .view.flat .stage { height: 400px; }
.view canvas { width: 100%; height: 100%; display: block; touch-action: none; cursor: grab; }
.view canvas.strip { position: absolute; right: 14px; bottom: 10px; width: 280px; height: 84px;
  background: var(--paper); border: 1px solid var(--edge); border-radius: 4px; pointer-events: none; }
.view canvas.strip[hidden] { display: none; }
.view canvas:focus-visible { outline: 2px solid var(--link); outline-offset: -2px; }
.view .tools { display: flex; flex-wrap: wrap; gap: .3rem 1.1rem; align-items: center; padding: .4rem .8rem;
  background: var(--wash); border-bottom: 1px solid var(--faint); font-size: .88rem; }
.view .tools button { margin-left: auto; }
.view .label { position: absolute; margin: 0; padding: .35rem .6rem; background: var(--paper);
  border: 1px solid var(--edge); pointer-events: none; font: inherit; font-size: .85rem; line-height: 1.4;
  white-space: pre; }
.view .scale { position: absolute; left: 14px; bottom: 10px; border-bottom: 3px solid var(--ink); font-size: .82rem;
  pointer-events: none; text-align: center; white-space: nowrap; }
.hint { color: var(--soft); font-size: .85rem; }
button { font: inherit; color: var(--link); background: none; border: 1px solid var(--edge); border-radius: 6px;
  padding: .05rem .5rem; cursor: pointer; }
.wide th, .wide td { padding: .5rem .45rem; } .wide td .badge { white-space: normal; border-radius: 10px; }
td button.feature { border: 0; padding: 0; font-weight: 600; text-align: left; white-space: nowrap; }
td button.feature:hover { text-decoration: underline; }
tr.chosen td { background: var(--chosen); }
.units { margin: .6rem 0 0; font-size: .92rem; color: var(--soft); }
select { font: inherit; color: inherit; background: var(--paper); border: 1px solid var(--edge); border-radius: 6px; }
nav { font-size: .92rem; margin-top: 1.1rem; } nav a { margin-right: 1.1rem; display: inline-block; }
:target { scroll-margin-top: 1rem; }
.table:focus-visible { outline: 2px solid var(--link); }
a { color: var(--link); text-decoration: none; } a:hover { text-decoration: underline; }
details { margin-top: .6rem; } summary { cursor: pointer; color: var(--soft); }
pre { background: var(--wash); padding: .8rem; border-radius: 8px; overflow: auto; font-size: .82rem; }
code { font-size: .9em; }
@media (max-width: 640px) { h1 { font-size: 1.5rem; } main { padding: 1.4rem .9rem 3rem; }
  .view .stage { height: 380px; }
  .table { max-height: none; } table { font-size: .86rem; } th, td { padding: .45rem .4rem; }
  th, th.number, td b, td span { white-space: normal; } .bar { max-width: 30vw; }
  /* a wide table as cards: each row one, each cell a line with the name of its column before it */
  .wide { border: 0; border-radius: 0; } .wide table, .wide tbody { display: block; }
  .wide thead { position: absolute; width: 1px; height: 1px; overflow: hidden; clip-path: inset(50%); }
  .wide tbody tr { display: table; width: 100%; border-collapse: separate; border-spacing: .7rem .35rem;
    margin: 0 0 .7rem; border: 1px solid var(--faint); border-radius: 8px; }
  .wide td, .wide td.number { display: table-row; text-align: left; } .wide td:not([data-label]) { display: none; }
  .wide td::before { content: attr(data-label); display: table-cell; width: 7.5rem; color: var(--soft);
    vertical-align: top; } td small.note { min-width: 0; } }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e4e7eb; --soft: #a8b4c2; --faint: #323f4b; --paper: #141b22; --wash: #1e2831; --link: #8fbcf0;
    --edge: #52606d; --chosen: #4a3f12; --warn: #33280f; --good: #163a29; --good-ink: #a5e0bf; --bad: #4a1d1d;
    --bad-ink: #f7b5b0; --plain: #2b3742; --plain-ink: #c4ced8; }
  /* drawn in ink on paper: light becomes dark and the hues stay; what holds pixels keeps its own */
  figure > svg:not(:has(image)) { filter: invert(.9) hue-rotate(180deg); }
}
@media print { .view, .hint, .units, .to-look, nav { display: none; } figure, tr, h2 { break-inside: avoid; }
  h2 { break-after: avoid; } .table { max-height: none; overflow: visible; } }
"""
