"""Chart: plots as SVG, written straight from arrays; no plotting library is loaded, and every size stays sharp."""

from __future__ import annotations

import base64
import struct
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from html import escape
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike, NDArray

from explore3d.pictures.figure import FAINT, INK, MUTED
from mapping import FloatArray

FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif"
FONT_SIZE = 12.0  # px, as the report's small print
# Width of a letter in units of the font's size: the widest of the fonts above, so that nothing runs together
LETTER = 0.6
SPAN_AIR = 0.05  # share of the data's span that stays free at each side
RIGHT_MARGIN = 1.2  # in units of the font's size: half of the last number of an axis
DASHED, DOTTED = "5 3", "1.5 2.5"
# Dots nearer than this are one dot, px: nobody sees them apart, and thousands of them weigh
DOT_GRID = 0.5
DECADES_WITHOUT_STEPS = 2.0  # a logarithmic axis over more decades has ticks at the powers of ten alone

# From data to px: one axis
Scale = Callable[[FloatArray], FloatArray]
# What is drawn, given the two scales; its swatch in the legend is drawn by the same function
Draw = Callable[[FloatArray, FloatArray], str]


def number(value: float) -> str:
    """A coordinate in px, in tenths: as short as it can be."""
    return f"{value:.1f}".removesuffix(".0")


def text_at(
    x: float,
    y: float,
    words: str,
    *,
    size: float = FONT_SIZE,
    colour: str = INK,
    anchor: str = "start",
    bold: bool = False,
    turned: float = 0.0,
) -> str:
    """A line of text whose base line begins (anchor start), is centred (middle) or ends (end) at (x, y), px."""
    weight = ' font-weight="600"' if bold else ""
    turn = f' transform="rotate({number(turned)} {number(x)} {number(y)})"' if turned else ""
    return (
        f'<text x="{number(x)}" y="{number(y)}" font-size="{number(size)}" fill="{colour}" '
        f'text-anchor="{anchor}"{weight}{turn}>{escape(words)}</text>'
    )


def text_width(words: str, size: float = FONT_SIZE) -> float:
    """How wide a line of text may become, px."""
    return LETTER * size * len(words)


def polyline(x: FloatArray, y: FloatArray, *, closed: bool = False) -> str:
    """Path data through points in px, broken where one is not finite."""
    parts, pen = [], "M"
    for a, b in zip(x.tolist(), y.tolist(), strict=True):
        if isfinite(a) and isfinite(b):
            parts.append(f"{pen}{number(a)} {number(b)}")
            pen = "L"
        else:
            pen = "M"
    return "".join(parts) + ("Z" if closed else "")


def stroke(data: str, colour: str, width: float, dash: str = "", opacity: float = 1.0) -> str:
    """A path that is drawn as a line."""
    more = f' stroke-dasharray="{dash}"' if dash else ""
    more += f' opacity="{opacity:g}"' if opacity < 1.0 else ""
    return (
        f'<path d="{data}" fill="none" stroke="{colour}" stroke-width="{number(width)}" stroke-linejoin="round" '
        f'stroke-linecap="{"butt" if dash else "round"}"{more}/>'
    )


def pixels_png(pixels: NDArray[np.uint8]) -> bytes:
    """A PNG file of pixels (H, W, 3), or (H, W, 4) with opacity; the same pixels give the same bytes."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    height, width, channels = pixels.shape
    rows = np.empty((height, 1 + width * channels), dtype=np.uint8)
    rows[:, 0] = 2  # the filter "up": what is stored is the difference to the pixel above
    flat = pixels.reshape(height, -1)
    rows[0, 1:] = flat[0]
    np.subtract(flat[1:], flat[:-1], out=rows[1:, 1:])
    head = struct.pack(">IIBBBBB", width, height, 8, {3: 2, 4: 6}[channels], 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", head)
        + chunk(b"IDAT", zlib.compress(rows.tobytes(), 6))
        + chunk(b"IEND", b"")
    )


def image(png: bytes, x: float, y: float, width: float, height: float) -> str:
    """A PNG file as a part of a drawing, stretched over a box in px."""
    data = base64.b64encode(png).decode("ascii")
    return (
        f'<image x="{number(x)}" y="{number(y)}" width="{number(width)}" height="{number(height)}" '
        f'preserveAspectRatio="none" href="data:image/png;base64,{data}"/>'
    )


def drawing(width: float, height: float, content: str) -> bytes:
    """A whole SVG file of width x height px on white."""
    size = f'width="{number(width)}" height="{number(height)}"'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} viewBox="0 0 {number(width)} {number(height)}" '
        f'font-family="{FONT}"><rect {size} fill="#fff"/>{content}</svg>\n'
    ).encode()


@dataclass(frozen=True)
class _Layer:
    """Something to draw: its points (N,) in the data's units, how, its name in the legend, and how it looks there."""

    x: FloatArray
    y: FloatArray
    draw: Draw
    name: str
    swatch: Draw
    clipped: bool = True


@dataclass
class Panel:
    """One plot: what is drawn in it, in the data's units, and the words around it.

    Args:
        title, x_name, y_name: above, below, and to the left.
        x_ticks, y_ticks: at most so many ticks.
        x_limits, y_limits: (low, high), or None for those of the data with a little air.
        log_y: a logarithmic ordinate.
        y_words: (place, word) pairs instead of numbers at the left.
        x_words: whether there are numbers below.
        x_grid, y_grid: thin lines at the ticks.
        font: size of its words, px.
        margins: (left, above, below) of the plot inside its box, px, or None for what its words need.
    """

    title: str = ""
    x_name: str = ""
    y_name: str = ""
    x_ticks: int = 7
    y_ticks: int = 6
    x_limits: tuple[float, float] | None = None
    y_limits: tuple[float, float] | None = None
    log_y: bool = False
    y_words: Sequence[tuple[float, str]] | None = None
    x_grid: bool = True
    y_grid: bool = True
    font: float = FONT_SIZE
    margins: tuple[float, float, float] | None = None
    x_words: bool = True
    layers: list[_Layer] = field(default_factory=list)

    def line(
        self, x: ArrayLike, y: ArrayLike, colour: str, *, width: float = 1.9, dash: str = "", name: str = ""
    ) -> None:
        """A line through points (N,), broken at NaN."""
        self._add(x, y, lambda u, v: stroke(polyline(u, v), colour, width, dash), name)

    def dots(
        self, x: ArrayLike, y: ArrayLike, colour: str, *, size: float, opacity: float = 1.0, name: str = ""
    ) -> None:
        """Round dots of `size` px at points (N,)."""

        def draw(u: FloatArray, v: FloatArray) -> str:
            cells = np.unique(np.rint(np.column_stack([u, v])[np.isfinite(u) & np.isfinite(v)] / DOT_GRID), axis=0)
            data = "".join(f"M{number(a)} {number(b)}h0" for a, b in (DOT_GRID * cells).tolist())
            return stroke(data, colour, size, opacity=opacity)

        def some(u: FloatArray, v: FloatArray) -> str:
            spread = np.linspace(u[0], u[-1], 5)
            return draw(spread, v[0] + np.array([0.0, -4.0, 2.0, -2.0, 3.0]))

        self._add(x, y, draw, name, swatch=some)

    def marks(
        self, x: ArrayLike, y: ArrayLike, colour: str, shape: str, *, size: float = 8.0, filled: bool = True,
        name: str = "", clipped: bool = True,
    ) -> None:  # fmt: skip
        """Marks of `size` px at points (N,): shape "o", or a triangle that points "v" down, "<" left, ">" right."""
        fill = colour if filled else "#fff"
        half = 0.5 * size

        def draw(u: FloatArray, v: FloatArray) -> str:
            return "".join(one(a, b) for a, b in zip(u.tolist(), v.tolist(), strict=True) if np.isfinite(a + b))

        def one(a: float, b: float) -> str:
            if shape == "o":
                return f'<circle cx="{number(a)}" cy="{number(b)}" r="{number(half)}" fill="{fill}" stroke="{colour}"/>'
            corners = {
                "v": ((-1, -1), (1, -1), (0, 1)),
                "<": ((1, -1), (1, 1), (-1, 0)),
                ">": ((-1, -1), (-1, 1), (1, 0)),
            }
            data = "L".join(f"{number(a + half * i)} {number(b + half * j)}" for i, j in corners[shape])
            return f'<path d="M{data}Z" fill="{fill}" stroke="{colour}"/>'

        self._add(x, y, draw, name, clipped=clipped)

    def bars(self, x: ArrayLike, y: ArrayLike, colour: str, *, width: float = 1.3, name: str = "") -> None:
        """Straight bars: x and y (N, 2) hold their two ends."""

        def draw(u: FloatArray, v: FloatArray) -> str:
            gap = np.full((len(u) // 2, 1), np.nan)
            pairs = [np.hstack([each.reshape(-1, 2), gap]).ravel() for each in (u, v)]
            return stroke(polyline(*pairs), colour, width)

        self._add(np.asarray(x, dtype=float).ravel(), np.asarray(y, dtype=float).ravel(), draw, name)

    def area(self, x: ArrayLike, y: ArrayLike, colour: str, *, name: str = "") -> None:
        """The inside of a closed polygon (N,)."""
        self._add(
            x,
            y,
            lambda u, v: f'<path d="{polyline(u, v, closed=True)}" fill="{colour}"/>',
            name,
            swatch=lambda u, v: stroke(polyline(u, v), colour, 9.0),
        )

    def level(self, y: float, colour: str, *, width: float = 1.3, dash: str = "", name: str = "") -> None:
        """A horizontal line from edge to edge."""
        self._add([-np.inf, np.inf], [y, y], lambda u, v: stroke(polyline(u, v), colour, width, dash), name)

    def upright(self, x: float, colour: str, *, width: float = 1.3, dash: str = "", name: str = "") -> None:
        """A vertical line from edge to edge."""
        self._add([x, x], [-np.inf, np.inf], lambda u, v: stroke(polyline(u, v), colour, width, dash), name)

    def span(self, low: float, high: float, colour: str) -> None:
        """A stripe from edge to edge between two abscissae."""
        x, y = [low, low, high, high], [-np.inf, np.inf, np.inf, -np.inf]
        self._add(x, y, lambda u, v: f'<path d="{polyline(u, v, closed=True)}" fill="{colour}"/>', "")

    def words(
        self, x: float, y: float, words: str, *, dx: float = 0.0, dy: float = 0.0, anchor: str = "start",
        size: float = FONT_SIZE,
    ) -> None:  # fmt: skip
        """A word beside a point, shifted by (dx, dy) px, y downwards."""

        def draw(u: FloatArray, v: FloatArray) -> str:
            return text_at(float(u[0]) + dx, float(v[0]) + dy, words, size=size, anchor=anchor)

        self._add([x], [y], draw, "", clipped=False)

    def _add(
        self, x: ArrayLike, y: ArrayLike, draw: Draw, name: str, *, clipped: bool = True, swatch: Draw | None = None
    ) -> None:
        x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
        self.layers.append(_Layer(x, y, draw, name, swatch or draw, clipped))

    def limits(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """The two ranges that the plot shows."""
        return (
            self.x_limits or _range([layer.x for layer in self.layers], False),
            self.y_limits or _range([layer.y for layer in self.layers], self.log_y),
        )

    def svg(self, left: float, top: float, width: float, height: float) -> str:
        """The panel inside a box in px, words included."""
        x_limits, y_limits = self.limits()
        y_marks = self._y_marks(y_limits)
        small = 0.92 * self.font
        room_left = (
            10.0
            + max((text_width(word, small) for _, word in y_marks), default=0.0)
            + (1.6 * self.font * (1 + self.y_name.count("\n")) if self.y_name else 0.0)
        )
        x_words = self.x_name.split("\n") if self.x_name else []
        room_below = 2.3 * self.font + 1.35 * self.font * len(x_words)
        room_above = 2.0 * self.font if self.title else 0.5 * self.font
        if self.margins is not None:
            room_left, room_above, room_below = self.margins
        inner = (
            left + room_left,
            top + room_above,
            width - room_left - RIGHT_MARGIN * self.font,
            height - room_above - room_below,
        )
        x, y = _scale(x_limits, 0.0, inner[2], False), _scale(y_limits, inner[3], 0.0, self.log_y)
        parts = [self._frame(inner, x, y, x_limits, y_marks, small), self._names(inner, x_words, left, top)]
        for clipped in (True, False):
            marks = "".join(layer.draw(x(layer.x), y(layer.y)) for layer in self.layers if layer.clipped is clipped)
            box = " ".join(
                f'{name}="{number(value)}"' for name, value in zip(("x", "y", "width", "height"), inner, strict=True)
            )
            if marks:
                parts.append(f'<svg {box} overflow="{"hidden" if clipped else "visible"}">{marks}</svg>')
        return "".join(parts)

    def _y_marks(self, limits: tuple[float, float]) -> list[tuple[float, str]]:
        if self.y_words is not None:
            return list(self.y_words)
        return _log_ticks(*limits) if self.log_y else _ticks(*limits, self.y_ticks)

    def _frame(
        self, inner: tuple[float, float, float, float], x: Scale, y: Scale, x_limits: tuple[float, float],
        y_marks: Sequence[tuple[float, str]], small: float,
    ) -> str:  # fmt: skip
        """Grid, axes and ticks."""
        left, top, width, height = inner
        x_marks = _ticks(*x_limits, self.x_ticks) if self.x_words else []
        columns = left + x(np.array([place for place, _ in x_marks]))
        rows = top + y(np.array([place for place, _ in y_marks]))
        grid = ""
        if self.x_grid:
            grid += "".join(f"M{number(each)} {number(top)}v{number(height)}" for each in columns)
        if self.y_grid:
            grid += "".join(f"M{number(left)} {number(each)}h{number(width)}" for each in rows)
        axes = f"M{number(left)} {number(top)}v{number(height)}h{number(width)}"
        axes += "".join(f"M{number(each)} {number(top + height)}v4" for each in columns)
        axes += "".join(f"M{number(left)} {number(each)}h-4" for each in rows)
        words = "".join(
            text_at(each, top + height + 5.0 + small, word, size=small, anchor="middle")
            for each, (_, word) in zip(columns, x_marks, strict=True)
        )
        words += "".join(
            text_at(left - 7.0, each + 0.35 * small, word, size=small, anchor="end")
            for each, (_, word) in zip(rows, y_marks, strict=True)
        )
        return (stroke(grid, FAINT, 0.8) if grid else "") + stroke(axes, MUTED, 1.0) + words

    def _names(
        self, inner: tuple[float, float, float, float], x_words: Sequence[str], box_left: float, box_top: float
    ) -> str:
        left, top, width, height = inner
        below = top + height + 2.2 * self.font
        parts = [
            text_at(left + 0.5 * width, below + 1.3 * self.font * (i + 0.6), words, size=self.font, anchor="middle")
            for i, words in enumerate(x_words)
        ]
        middle = top + 0.5 * height
        for i, words in enumerate(self.y_name.split("\n") if self.y_name else []):
            place = box_left + self.font * (1.0 + 1.3 * i)
            parts.append(text_at(place, middle, words, size=self.font, anchor="middle", turned=-90.0))
        if self.title:
            parts.append(text_at(left, box_top + 1.2 * self.font, self.title, size=1.05 * self.font, bold=True))
        return "".join(parts)


def sheet(panels: Sequence[Panel], width: float, row_height: float, columns: int = 1, *, legend: bool = False) -> bytes:
    """An SVG file of panels in rows of `columns`, all of one size, with one legend above them all.

    Args:
        panels: at least one.
        width, row_height: of the whole, and of each row, px.
        columns: panels beside one another.
        legend: name what is drawn, each name once.
    """
    top, content = _legend(panels, width) if legend else (0.0, "")
    wide = width / columns
    for place, panel in enumerate(panels):
        row, column = divmod(place, columns)
        content += panel.svg(column * wide, top + row * row_height, wide, row_height)
    return drawing(width, top + row_height * -(-len(panels) // columns), content)


def _legend(panels: Sequence[Panel], width: float) -> tuple[float, str]:
    """Height in px, and what is drawn: a swatch and a name for each layer that has one."""
    known: dict[str, _Layer] = {}
    for panel in panels:
        for layer in panel.layers:
            if layer.name:
                known.setdefault(layer.name, layer)
    x, y, parts = FONT_SIZE, 1.6 * FONT_SIZE, []
    for name, layer in known.items():
        wide = 34.0 + text_width(name) + 14.0
        if x > FONT_SIZE and x + wide > width:
            x, y = FONT_SIZE, y + 1.6 * FONT_SIZE
        parts.append(layer.swatch(np.array([x, x + 24.0]), np.array([y - 4.0, y - 4.0])))
        parts.append(text_at(x + 32.0, y, name))
        x += wide
    return y + 0.7 * FONT_SIZE, "".join(parts)


def _range(parts: Sequence[FloatArray], log: bool) -> tuple[float, float]:
    """The range of all finite values, and a little air."""
    values = np.concatenate([np.zeros(0), *parts])
    values = values[np.isfinite(values) & ((values > 0) | (not log))]
    if len(values) == 0:
        return 0.0, 1.0
    low, high = float(values.min()), float(values.max())
    if log:
        air = (high / low) ** SPAN_AIR if high > low else 2.0
        return low / air, high * air
    air = SPAN_AIR * (high - low) or 0.5 * abs(high) or 1.0
    return low - air, high + air


def _scale(limits: tuple[float, float], first: float, last: float, log: bool) -> Scale:
    """From data to px: the limits fall on `first` and `last`; infinite values on the nearer edge."""
    low, high = np.log10(limits) if log else np.asarray(limits)

    def place(values: FloatArray) -> FloatArray:
        with np.errstate(invalid="ignore", divide="ignore"):
            share = ((np.log10(values) if log else values) - low) / (high - low)
        share = np.where(np.isposinf(share), 1.0, np.where(np.isneginf(share), 0.0, share))
        return np.asarray(first + (last - first) * share)

    return place


def _ticks(low: float, high: float, most: int) -> list[tuple[float, str]]:
    """Round places between the limits, at most about `most` but two at least, with their numbers."""
    rough = (high - low) / max(most, 1)
    power = 10.0 ** np.floor(np.log10(rough))
    factors = (0.1, 0.2, 0.25, 0.5, 1.0, 2.0, 2.5, 5.0, 10.0)
    number = next(i for i, factor in enumerate(factors) if factor * power >= rough * (1.0 - 1e-9))
    for factor in factors[number::-1]:  # one number alone tells no scale
        step = factor * power
        places = step * np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1)
        if len(places) > 1:
            break
    digits = next(count for count in range(20) if np.isclose(step, round(step, count), rtol=1e-6, atol=0.0))
    return [(float(place), f"{round(place, digits) + 0.0:.{digits}f}".replace("-", "−")) for place in places]


def _log_ticks(low: float, high: float) -> list[tuple[float, str]]:
    """Powers of ten between the limits, and two and five times them where the range is short."""
    steps = (1.0,) if np.log10(high / low) > DECADES_WITHOUT_STEPS else (1.0, 2.0, 5.0)
    powers = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    return [
        (step * 10.0**power, f"{step * 10.0**power:.10g}")
        for power in powers
        for step in steps
        if low <= step * 10.0**power <= high
    ]
