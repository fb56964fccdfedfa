"""A figure as a description: axes with lines, points, bands, boxes and words; and its SVG, written directly.

Matplotlib takes a tenth of a second for a small figure, a report has dozens. A sheet holds what they need,
in the style of ``style``; ``style.painted`` makes a Matplotlib figure of the same sheet for who wants one.

Sizes are in points (72 an inch), y upwards as in Matplotlib; text stays text.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.report.figures.palette import INK
from mrdamper.report.figures.ticks import labels_of, nice_ticks

INCH = 72.0  # points
LETTER = 0.6  # mean width of a letter over its size
TEXT, SMALL, TITLE = 7.5, 7.0, 8.0  # sizes of letters [pt]: labels, ticks and keys, titles
_GRID, _SPINE, _TICK_INK = "#e8e8e8", "#888888", "#666666"
_DASHES = {"-": "", "--": "3.7 1.6", ":": "1 1.65"}  # in widths of the line


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """A line through points; ``style`` is -, -- or :."""

    x: FloatArray
    y: FloatArray
    colour: str
    width: float = 0.9
    style: str = "-"


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Points, filled with their colour or with another; ``diamond`` or round."""

    x: Sequence[float]
    y: Sequence[float]
    colour: str
    size: float = 4.0
    face: str = ""  # empty: the colour
    diamond: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Band:
    """What lies between two curves."""

    x: FloatArray
    low: FloatArray
    high: FloatArray
    colour: str
    opacity: float


@dataclass(frozen=True, slots=True)
class Box:
    """A rectangle from one corner to the other."""

    left: float
    low: float
    right: float
    high: float
    colour: str


@dataclass(frozen=True, slots=True)
class Words:
    """A text at a point of the axes, its middle at the point's height."""

    x: float
    y: float
    text: str
    size: float
    colour: str
    anchor: str = "start"  # start, middle, end
    right: float = 0.0  # shift [pt]


@dataclass(frozen=True, slots=True)
class Key:
    """An entry of a legend."""

    label: str
    colour: str
    style: str = "-"
    width: float = 1.4


Mark = Line | Points | Band | Box | Words


@dataclass(slots=True)
class Axes:
    """Axes that are filled mark by mark; limits are those of the marks, and a twentieth more, until given.

    Attributes
    ----------
    place : left, low, right and high end on the sheet [pt]
    few : ticks at most, about
    log : both axes are logarithmic
    spines : axes are drawn, with ticks
    """

    place: tuple[float, float, float, float]
    title: str = ""
    bold: bool = False
    x_label: str = ""
    y_label: str = ""
    x_ends: tuple[float, float] | None = None
    y_ends: tuple[float, float] | None = None
    x_ticks: Sequence[float] | None = None
    y_ticks: Sequence[float] | None = None
    x_names: Sequence[str] | None = None
    y_names: Sequence[str] | None = None
    y_named: bool = True
    few: int = 9
    log: bool = False
    grid: str = "xy"  # along which axes there are lines of a grid
    spines: bool = True
    upright: bool = False  # names of x are written upwards
    names_right: bool = False  # names of y are written to the right
    tick: float = 3.5  # length
    marks: list[Mark] = field(default_factory=list)

    def line(self, x: FloatArray, y: FloatArray, colour: str, width: float = 0.9, style: str = "-") -> None:
        """Add a line."""
        self.marks.append(Line(np.asarray(x), np.asarray(y), colour, width, style))

    def level(self, y: float, colour: str = _SPINE, width: float = 0.6) -> None:
        """Add a horizontal line from end to end, once the ends of x are known."""
        low, high = self.ends[0]
        self.x_ends = (low, high)
        self.line(np.array([low, high]), np.array([y, y]), colour, width)

    @property
    def ends(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Limits of x and of y."""
        spans = _spans(self.marks)
        return self.x_ends or _widened(*spans[0]), self.y_ends or _widened(*spans[1])

    @property
    def ticks(self) -> tuple[Sequence[float], Sequence[float]]:
        """Where the ticks of x and of y are."""
        x_ends, y_ends = self.ends
        return (
            nice_ticks(x_ends, self.few) if self.x_ticks is None else self.x_ticks,
            nice_ticks(y_ends, self.few) if self.y_ticks is None else self.y_ticks,
        )


@dataclass(slots=True)
class Sheet:
    """A figure of so many inches, its axes, texts and legend.

    Attributes
    ----------
    words : texts at shares of width and height, by their upper left corner
    keys : of the legend
    keys_at : ``right``: a column at the right edge; ``top``: a row at the upper right corner
    """

    width: float
    height: float
    axes: list[Axes] = field(default_factory=list)
    words: list[Words] = field(default_factory=list)
    keys: list[Key] = field(default_factory=list)
    keys_at: str = "right"
    keys_title: str = ""

    def add(self, left: float, low: float, right: float, high: float) -> Axes:
        """Return new axes between these places [inch from the lower left corner]."""
        self.axes.append(Axes((left * INCH, low * INCH, right * INCH, high * INCH)))
        return self.axes[-1]

    def table(
        self,
        rows: int,
        columns: int,
        *,
        left: float,
        right: float,
        top: float,
        bottom: float,
        wspace: float = 0.0,
        hspace: float = 0.0,
    ) -> list[Axes]:
        """Return axes in rows; edges are shares of the sheet, gaps shares of one axes' size."""
        across = (right - left) / (columns + wspace * (columns - 1))
        tall = (top - bottom) / (rows + hspace * (rows - 1))
        found = []
        for k in range(rows * columns):
            row, column = divmod(k, columns)
            x, y = left + column * across * (1.0 + wspace), top - row * tall * (1.0 + hspace)
            found.append((x, y - tall, x + across, y))
        w, h = self.width, self.height
        return [self.add(a * w, b * h, c * w, d * h) for a, b, c, d in found]

    def svg(self, label: str) -> str:
        """Return the sheet as an SVG element; its bytes depend on the sheet alone."""
        wide, tall = self.width * INCH, self.height * INCH
        said = re.sub(r"[^\w .,+-]", "_", label)  # an attribute: nothing in it may end it
        parts = [
            f'<svg role="img" aria-label="{said}" xmlns="http://www.w3.org/2000/svg" width="{_n(wide)}pt" '
            f'height="{_n(tall)}pt" viewBox="0 0 {_n(wide)} {_n(tall)}" '
            'font-family="DejaVu Sans, sans-serif" '
            f'font-size="{TEXT:g}" fill="{INK}" stroke-linejoin="round">',
            f'<rect width="{_n(wide)}" height="{_n(tall)}" fill="#ffffff"/>',
            *(line for axes in self.axes if axes.marks for line in _axes(axes, tall)),
            *(
                _text(
                    each.x * wide, (1.0 - each.y) * tall + 0.8 * each.size, each.text, each.size, each.colour
                )
                for each in self.words
            ),
            *self._legend(wide, tall),
            "</svg>",
        ]
        return "\n".join(parts)

    def _legend(self, wide: float, tall: float) -> list[str]:
        """Return the legend's lines: a column at the right edge, or a row along the top."""
        if not self.keys:
            return []
        widths = [LETTER * SMALL * len(key.label) for key in self.keys]
        if self.keys_at == "right":
            x, y = wide - 22.0 - max(widths) - 3.0, 0.45 * tall - 5.2 * (len(self.keys) - 1)
            places = [(x, y + 10.4 * k) for k in range(len(self.keys))]
            title: list[str] = []
        else:
            ends = np.cumsum([each + 34.0 for each in widths[::-1]])[::-1].tolist()
            places = [(wide - end, 7.0) for end in ends]
            x = places[0][0] - 10.0
            title = [_text(x, 9.5, self.keys_title, SMALL, INK, "end")] if self.keys_title else []
        return [
            *title,
            *(
                f'<path d="M{_n(x)} {_n(y)}h14" {_stroke(key.colour, key.width, key.style)}/>'
                + _text(x + 18.0, y + 2.5, key.label, SMALL, INK)
                for key, (x, y) in zip(self.keys, places, strict=True)
            ),
        ]


def _spans(marks: Sequence[Mark]) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return least and largest x, and y, of marks."""
    xs, ys = [], []
    for each in marks:
        if isinstance(each, Line | Points) and len(each.x):
            xs.append(each.x)
            ys.append(each.y)
        elif isinstance(each, Band):
            xs.append(each.x)
            ys += [each.low, each.high]
    return _span(xs), _span(ys)


def _span(arrays: Sequence[FloatArray | Sequence[float]]) -> tuple[float, float]:
    finite = [known for each in arrays if len(known := np.asarray(each)[np.isfinite(each)])]
    return (min(map(np.min, finite)), max(map(np.max, finite))) if finite else (0.0, 1.0)


def _widened(low: float, high: float) -> tuple[float, float]:
    margin = 0.05 * (high - low) or 0.05 * abs(high) or 0.05
    return float(low - margin), float(high + margin)


@dataclass(frozen=True, slots=True)
class _Scale:
    """From values to places on the sheet [pt]."""

    ends: tuple[float, float]
    places: tuple[float, float]
    log: bool

    def at(self, values: FloatArray | Sequence[float] | float) -> FloatArray:
        low, high = np.log10(self.ends) if self.log else self.ends
        given = np.asarray(values, dtype=np.float64)
        shares = ((np.log10(given) if self.log else given) - low) / (high - low)
        return np.asarray(self.places[0] + shares * (self.places[1] - self.places[0]))


def _axes(axes: Axes, tall: float) -> list[str]:
    """Return the lines of one axes' SVG."""
    left, low, right, high = axes.place
    bottom, top = tall - low, tall - high  # downwards from here on
    x_ends, y_ends = axes.ends
    x, y = _Scale(x_ends, (left, right), axes.log), _Scale(y_ends, (bottom, top), axes.log)
    x_ticks, y_ticks = axes.ticks
    across, upwards = x.at(x_ticks).tolist(), y.at(y_ticks).tolist()
    lines = []
    grid = [f"M{_n(at)} {_n(bottom)}V{_n(top)}" for at in across if "x" in axes.grid]
    grid += [f"M{_n(left)} {_n(at)}H{_n(right)}" for at in upwards if "y" in axes.grid]
    if grid:
        lines.append(f'<path d="{"".join(grid)}" {_stroke(_GRID, 0.5)}/>')
    lines += [_mark(each, x, y) for each in axes.marks]
    if axes.spines:
        ticks = [f"M{_n(at)} {_n(bottom)}v{axes.tick:g}" for at in across]
        ticks += [f"M{_n(left)} {_n(at)}h{-axes.tick:g}" for at in upwards if axes.y_names is None]
        lines.append(f'<path d="{"".join(ticks)}" {_stroke(_TICK_INK, 0.6)}/>')
        spine = f"M{_n(left)} {_n(top)}V{_n(bottom)}H{_n(right)}"
        lines.append(f'<path d="{spine}" {_stroke(_SPINE, 0.6)}/>')
    return [*lines, *_names(axes, across, upwards, tall)]


def _names(axes: Axes, across: Sequence[float], upwards: Sequence[float], tall: float) -> list[str]:
    """Return names of ticks, labels and title."""
    left, low, right, high = axes.place
    bottom, top, out = tall - low, tall - high, (axes.tick if axes.spines else 0.0) + 3.5
    x_names, _ = (axes.x_names, "") if axes.x_names is not None else labels_of(axes.ticks[0])
    y_names, power = (axes.y_names, "") if axes.y_names is not None else labels_of(axes.ticks[1])
    found = []
    for at, name in zip(across, x_names, strict=True):
        if axes.upright:
            place = f'transform="translate({_n(at + 2.5)} {_n(bottom + out)}) rotate(-90)"'
            looks = f'text-anchor="end" font-size="{SMALL:g}" fill="{_TICK_INK}"'
            found.append(f"<text {place} {looks}>{escape(name)}</text>")
        else:
            found.append(_text(at, bottom + out + 5.3, name, SMALL, _TICK_INK, "middle"))
    widest = 0.0
    if axes.y_named:
        side = right + out if axes.names_right else left - out
        anchor = "start" if axes.names_right else "end"
        found += [
            _text(side, at + 2.55, name, SMALL, _TICK_INK, anchor)
            for at, name in zip(upwards, y_names, strict=True)
        ]
        widest = max((LETTER * SMALL * len(name) for name in y_names), default=0.0)
    if axes.x_label:
        found.append(_text((left + right) / 2.0, bottom + out + 15.0, axes.x_label, TEXT, INK, "middle"))
    if axes.y_label:
        place = f"translate({_n(left - out - widest - 4.0)} {_n((bottom + top) / 2.0)}) rotate(-90)"
        found.append(f'<text transform="{place}" text-anchor="middle">{escape(axes.y_label)}</text>')
    if power:
        found.append(_text(left, top - 2.0, power, SMALL, _TICK_INK, "end"))
    if axes.title:
        weight = ' font-weight="bold"' if axes.bold else ""
        found.append(_text(left, top - 4.0, axes.title, TITLE, INK, more=weight))
    return found


def _mark(mark: Mark, x: _Scale, y: _Scale) -> str:
    """Return the SVG of one mark."""
    if isinstance(mark, Line):
        path = _path(x.at(mark.x), y.at(mark.y))
        return f'<path d="{path}" {_stroke(mark.colour, mark.width, mark.style)}/>'
    if isinstance(mark, Band):
        low, high = (y.at(np.clip(each, *y.ends)) for each in (mark.low, mark.high))
        at = x.at(mark.x)
        path = _path(np.concatenate([at, at[::-1]]), np.concatenate([low, high[::-1]]))
        return f'<path d="{path}Z" fill="{mark.colour}" fill-opacity="{mark.opacity:g}"/>'
    if isinstance(mark, Points):
        places = zip(x.at(mark.x).tolist(), y.at(mark.y).tolist(), strict=True)
        h = mark.size / 2.0 * (math.sqrt(2.0) if mark.diamond else 1.0)
        round_one = "a{0} {0} 0 1 0 {1} 0a{0} {0} 0 1 0 -{1} 0Z".format(_n(h), _n(2.0 * h))
        shape = "l{0} -{0}l{0} {0}l-{0} {0}Z".format(_n(h)) if mark.diamond else round_one
        path = "".join(f"M{_n(a - h)} {_n(b)}{shape}" for a, b in places)
        fill = mark.face or mark.colour
        return f'<path d="{path}" stroke="{mark.colour}" stroke-width="0.9" fill="{fill}"/>'
    if isinstance(mark, Box):
        (a, b), (c, d) = x.at([mark.left, mark.right]).tolist(), y.at([mark.low, mark.high]).tolist()
        size = f'width="{_n(abs(b - a))}" height="{_n(abs(c - d))}"'
        return f'<rect x="{_n(min(a, b))}" y="{_n(min(c, d))}" {size} fill="{mark.colour}"/>'
    right, down = float(x.at(mark.x)) + mark.right, float(y.at(mark.y)) + 0.36 * mark.size
    rim = "" if mark.colour == "white" else ' stroke="#ffffff" stroke-width="1.5" paint-order="stroke"'
    return _text(right, down, mark.text, mark.size, mark.colour, mark.anchor, more=rim)


def _path(x: FloatArray, y: FloatArray) -> str:
    """Return a line through points, to hundredths of a point, which is less than anyone sees."""
    known = np.isfinite(x) & np.isfinite(y)
    if not known.any():
        return ""
    flat = np.column_stack([x[known], y[known]]).ravel().tolist()
    return "M" + ("%.2f %.2f " * (len(flat) // 2) % tuple(flat)).rstrip()


def _stroke(colour: str, width: float, style: str = "-") -> str:
    dash = " ".join(_n(float(each) * width) for each in _DASHES[style].split())
    dashed = f' stroke-dasharray="{dash}"' if dash else ""
    return f'fill="none" stroke="{colour}" stroke-width="{width:g}"{dashed}'


def _text(
    x: float, y: float, text: str, size: float, colour: str, anchor: str = "start", *, more: str = ""
) -> str:
    where = "" if anchor == "start" else f' text-anchor="{anchor}"'
    looks = f'{where} font-size="{size:g}" fill="{colour}"{more}'
    return f'<text x="{_n(x)}" y="{_n(y)}"{looks}>{escape(text)}</text>'


def _n(value: float) -> str:
    """Return a number with two decimals at most."""
    return f"{value:.2f}".rstrip("0").rstrip(".")
