"""Draws docs/architecture.png from the sources: the rooms of the four packages, and who imports whom.

Run it from the project's folder after rooms have moved: python docs/draw_architecture.py. Needs matplotlib alone.
"""

from __future__ import annotations

import ast
from collections import Counter
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("mapping", "hw", "planners", "explore3d")  # each imports itself and those before it
TITLES = {
    "mapping": "mapping: surfaces and inference",
    "hw": "hw: what touches",
    "planners": "planners: where to touch next",
    "explore3d": "explore3d: the application",
}
# Files that lie in a package itself stand for its nouns
NOUNS = "nouns"
# Ways in of a few lines, that stand above all rooms
WAYS_IN = {"explore3d/run.py", "explore3d/analyze.py", "explore3d/__main__.py"}
INK, MUTED, EDGE = "#1f2933", "#7b8794", "#829ab1"
COLORS = {"mapping": "#e3eef9", "hw": "#e5f2e5", "planners": "#fdf1dc", "explore3d": "#f6e6ee"}
WIDTH, HEIGHT, GAP_X, GAP_Y = 1.12, 0.36, 0.34, 0.34
BETWEEN = 0.5  # packages


def room_of(module: str) -> str:
    """package.room of a module; a file beside the rooms belongs to the package's nouns."""
    parts = module.split(".")
    folder = ROOT / "/".join(parts[:2])
    return f"{parts[0]}.{parts[1] if len(parts) > 1 and folder.is_dir() else NOUNS}"


@cache
def defined_in(folder: str) -> dict[str, str]:
    """The names on a folder's doorway, and the module of each."""
    for node in ast.parse((ROOT / folder.replace(".", "/") / "__init__.py").read_text("utf-8")).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "_PUBLIC":
            table = ast.literal_eval(node.value)
            return {name: f"{folder}.{file}" for file, names in table.items() for name in names}
    return {}


def imports() -> Counter[tuple[str, str]]:
    """(room that imports, room that is imported): number of names, imports inside functions included."""
    found: Counter[tuple[str, str]] = Counter()
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            if path.name == "__init__.py" or path.relative_to(ROOT).as_posix() in WAYS_IN:
                continue  # doorways hand on, they do not use
            here = room_of(".".join(path.relative_to(ROOT).with_suffix("").parts))
            for node in ast.walk(ast.parse(path.read_text("utf-8"))):
                if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] in PACKAGES:
                    folder = ROOT / node.module.replace(".", "/")
                    door = defined_in(node.module) if folder.is_dir() else {}
                    for alias in node.names:
                        found[here, room_of(door.get(alias.name, node.module))] += 1
    return Counter({pair: count for pair, count in found.items() if pair[0] != pair[1]})


def floors(package: str, arrows: Counter[tuple[str, str]]) -> list[list[str]]:
    """The package's rooms, floor by floor: each stands just above the highest one that it imports."""
    rooms = {room for pair in arrows for room in pair if room.startswith(package + ".")}
    below = {room: {b for a, b in arrows if a == room and b in rooms} for room in rooms}
    level: dict[str, int] = {}
    while len(level) < len(rooms):
        ready = [room for room in rooms - level.keys() if below[room] <= level.keys()]
        if not ready:
            raise ValueError(f"{package}: these rooms import each other in a circle: {sorted(rooms - level.keys())}")
        level |= {room: 1 + max((level[each] for each in below[room]), default=-1) for room in ready}
    return [sorted(room for room in rooms if level[room] == floor) for floor in range(1 + max(level.values()))]


def necessary(package: str, arrows: Counter[tuple[str, str]]) -> list[tuple[str, str]]:
    """The package's own arrows without those that a longer way says already (the transitive reduction)."""
    own = {(a, b) for a, b in arrows if a.startswith(package + ".") and b.startswith(package + ".")}
    after: dict[str, set[str]] = {}
    for a, b in own:
        after.setdefault(a, set()).add(b)

    def reach(room: str) -> set[str]:
        return set().union(*({b} | reach(b) for b in after.get(room, ())))

    return sorted((a, b) for a, b in own if not any(b in reach(c) for c in after[a] if c != b))


def draw() -> Any:
    """The picture: one column a package, ground floor below; an arrow points to what is imported."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure
    from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

    arrows = imports()
    houses = {package: floors(package, arrows) for package in reversed(PACKAGES)}
    widths = {p: max(1.7, max(map(len, house))) * (WIDTH + GAP_X) + GAP_X for p, house in houses.items()}
    tall = max(len(house) for house in houses.values()) * (HEIGHT + GAP_Y) + 0.9
    total = sum(widths.values()) + BETWEEN * (len(houses) - 1)
    with rc_context({"font.family": "DejaVu Sans", "font.size": 8.5}):
        figure = Figure(figsize=(total + 0.3, tall + 0.75), dpi=110)
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set_xlim(-0.15, total + 0.15)
        axes.set_ylim(-0.65, tall + 0.1)
        axes.set_axis_off()
        left, edges = 0.0, []
        places: dict[str, tuple[float, float]] = {}
        for package, house in houses.items():
            box = FancyBboxPatch((left, 0), widths[package], tall - 0.1, boxstyle="round,pad=0,rounding_size=0.1")
            box.set(facecolor=COLORS[package], edgecolor="none")
            axes.add_patch(box)
            axes.text(left + widths[package] / 2, tall - 0.3, TITLES[package], ha="center", va="center", weight="bold")
            for floor, rooms in enumerate(house):
                y = 0.3 + floor * (HEIGHT + GAP_Y)
                below = {room: [places[b][0] for a, b in necessary(package, arrows) if a == room] for room in rooms}
                over = {room: sum(xs) / len(xs) if xs else left + widths[package] / 2 for room, xs in below.items()}
                used = len(rooms) * (WIDTH + GAP_X) - GAP_X
                begin = left + (widths[package] - used) / 2 if len(rooms) > 1 else over[rooms[0]] - WIDTH / 2
                for number, room in enumerate(sorted(rooms, key=lambda each: (over[each], each))):
                    x = begin + number * (WIDTH + GAP_X)
                    places[room] = (x + WIDTH / 2, y)
                    shape = FancyBboxPatch((x, y), WIDTH, HEIGHT, boxstyle="round,pad=0,rounding_size=0.06")
                    shape.set(facecolor="white", edgecolor=EDGE, zorder=3)
                    axes.add_patch(shape)
                    name = room.split(".")[1]
                    style = "italic" if name == NOUNS else "normal"
                    axes.text(x + WIDTH / 2, y + HEIGHT / 2, name, ha="center", va="center", style=style, zorder=4)
            for a, b in necessary(package, arrows):
                start, stop = places[a], places[b]
                arrow = FancyArrowPatch(start, (stop[0], stop[1] + HEIGHT), arrowstyle="-|>", shrinkA=0, shrinkB=0)
                arrow.set(mutation_scale=8, color=MUTED, linewidth=0.8, zorder=2)
                axes.add_patch(arrow)
            edges.append((left, left + widths[package]))
            left += widths[package] + BETWEEN
        for (_, right), (begin, _) in pairwise(edges):
            ends = (right + 0.03, tall - 0.45), (begin - 0.03, tall - 0.45)
            wide = FancyArrowPatch(*ends, arrowstyle="-|>", shrinkA=0, shrinkB=0)
            wide.set(color=INK, linewidth=2.5, mutation_scale=16, zorder=5)
            axes.add_patch(wide)
        note = "An arrow points to what is imported; arrows that a longer way implies are left out. "
        note += f"Drawn by docs/draw_architecture.py from {sum(arrows.values())} imported names."
        axes.text(0, -0.35, note, color=MUTED, va="center")
    return figure


if __name__ == "__main__":
    draw().savefig(ROOT / "docs" / "architecture.png", facecolor="white", metadata={"Software": None})
