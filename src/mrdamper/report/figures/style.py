"""Style of all figures, their axes and legends, and conversion of figures to inline SVG.

The bytes of an SVG depend only on its content. Texts are stored as text, which is small and searchable.
"""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Literal

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

MEASURED = "#b3b3b3"
HELD_OUT = "#c8553d"
TRAINING = "#4a6d8c"
INK = "#333333"
LIMIT = "#a03020"
SERIES = (TRAINING, "#b08a3c", HELD_OUT, "#7a5c8e")  # colours of curves at equal current and temperature
DASHED = (0, (5, 2))
WIDTH_INCH = 10.6  # The page is 1130 px wide.
LEFT_INCH, BOTTOM_INCH, RIGHT_INCH, TOP_INCH = 0.6, 0.42, 0.1, 0.25  # margins for labels and titles
LEGEND_INCH = 1.45

Share = Literal["", "all", "row"]

_DECIMALS = re.compile(r"(\.\d\d)\d+")

_STYLE: dict[str, object] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "mrdamper",
    "font.family": ["sans-serif"],
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 7.5,
    "axes.titlesize": 8.0,
    "axes.labelsize": 7.5,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "legend.fontsize": 7.0,
    "legend.title_fontsize": 7.0,
    "legend.frameon": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#888888",
    "axes.labelcolor": INK,
    "xtick.color": "#666666",
    "ytick.color": "#666666",
    "text.color": INK,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.1,
    "lines.markersize": 4.0,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e8e8e8",
    "grid.linewidth": 0.5,
    "text.parse_math": False,
    "axes.formatter.useoffset": False,
    "axes.titlelocation": "left",
    "axes.titlepad": 4.0,
    "axes.labelpad": 2.0,
    "path.simplify": True,
    "path.simplify_threshold": 0.1,
}


def colour_of(command: float | None, highest: float) -> str:
    """Return the colour of a current [A] or voltage [V], dark blue at zero, ochre at the highest value."""
    ratio = 1.0 if command is None or highest == 0.0 else min(abs(command) / highest, 1.0)
    return to_hex(mpl.colormaps["viridis"](0.08 + 0.70 * ratio))


def colour_of_temperature(temperature: float, levels: Sequence[float]) -> str:
    """Return the colour of a temperature [K or degC], from violet to orange in the range of ``levels``."""
    low, high = min(levels), max(levels)
    ratio = 0.5 if low == high else (temperature - low) / (high - low)
    return to_hex(mpl.colormaps["plasma"](0.05 + 0.70 * ratio))


def shortened(name: str, longest: int = 40) -> str:
    """Return a name of at most ``longest`` characters. A longer name loses its middle part."""
    return name if len(name) <= longest else f"{name[: longest // 2]}...{name[-longest // 2 + 3 :]}"


@contextmanager
def drawing_style() -> Iterator[None]:
    """Set the style of all figures that are drawn in a ``with`` block.

    Warnings about letters that the font of Matplotlib lacks are disabled, because browsers have other fonts.
    """
    with mpl.rc_context(_STYLE), warnings.catch_warnings():  # type: ignore[arg-type]  # stubs list every key
        warnings.filterwarnings("ignore", r"Glyph \d+ .* missing from font", UserWarning)
        yield


def svg_of(figure: Figure, label: str) -> str:
    """Convert a figure to an SVG element without header, dates and unused ids."""
    buffer = io.StringIO()
    FigureCanvasSVG(figure).print_svg(  # type: ignore[no-untyped-call]
        buffer, metadata={"Date": None, "Creator": None, "Format": None, "Type": None}
    )
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r'(?<=<g) id="[\w.]+"|(?<=<path) id="[\w.]+_\d+"', "", text)
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    text = re.sub(r"\n\s*\n+|\n\s+", "\n", text)
    # Coordinates are rounded, because differences of a hundredth of a point are invisible.
    text = re.sub(r'(?<= )(d|x|y)="[^"]*"', lambda found: _DECIMALS.sub(r"\1", found[0]), text)
    escaped = re.sub(r"[^\w .,+-]", "_", label)  # Quotation marks are not allowed in an attribute.
    return text.replace("<svg", f'<svg role="img" aria-label="{escaped}"', 1)


def svg_drawn_by(draw: Callable[[], Figure | None], label: str) -> str:
    """Return the figure of ``draw`` as SVG element, or "" if ``draw`` returns None."""
    with drawing_style():
        figure = draw()
        return "" if figure is None else svg_of(figure, label)


def displayable(draw: Callable[[], Figure | None], label: str) -> Figure | None:
    """Return the figure of ``draw``, which notebooks then display as SVG, or None."""
    with drawing_style():
        figure = draw()
    if figure is not None:
        vars(figure)["_repr_svg_"] = lambda: svg_drawn_by(lambda: figure, label)
    return figure


def panels(
    count: int,
    columns: int = 4,
    *,
    height: float = 1.35,
    gap: float = 0.5,
    right: float = RIGHT_INCH,
    top: float = TOP_INCH,
    share: Share = "",
) -> tuple[Figure, list[Axes]]:
    """Return an empty figure and its axes, row by row from the top left.

    Parameters
    ----------
    height : height of the axes [inch]
    gap : space between two columns [inch]
    right, top : margins, for a legend [inch]
    share : "all": all y axes have the same limits; "row": the y axes of a row have the same limits
    """
    row_gap_inch = 0.62  # space for the labels of a row and the titles of the next row
    columns = min(columns, count)
    rows = -(-count // columns)
    gaps = gap * (columns - 1)
    width = min(WIDTH_INCH, LEFT_INCH + right + gaps + columns * 5.6)
    whole = top + rows * height + (rows - 1) * row_gap_inch + BOTTOM_INCH
    figure = Figure(figsize=(width, whole))
    table = figure.subplots(
        rows,
        columns,
        squeeze=False,
        sharex="row" if share == "row" else False,
        sharey=share or False,
        gridspec_kw={
            "left": LEFT_INCH / width,
            "right": 1.0 - right / width,
            "bottom": BOTTOM_INCH / whole,
            "top": 1.0 - top / whole,
            "wspace": gap * columns / (width - LEFT_INCH - right - gaps),
            "hspace": row_gap_inch / height,
        },
    ).ravel()
    for axes in table[count:]:
        axes.remove()
    return figure, list(table[:count])


def add_legend(
    figure: Figure, entries: Sequence[tuple[str, str, str]], *, title: str = "", at_top: bool = False
) -> None:
    """Add a legend to a figure: a column at the right edge, or a row at the top.

    An entry consists of label, colour and line style. Equal entries are shown once.
    """
    entries = list(dict.fromkeys(entries))
    if not entries:
        return
    figure.legend(
        [Line2D([], [], color=colour, ls=style, lw=1.4) for _, colour, style in entries],
        [label for label, _, _ in entries],
        loc="upper right" if at_top else "center right",
        ncols=len(entries) if at_top else 1,
        title=title or None,
        handlelength=1.8,
        columnspacing=1.2,
        borderaxespad=0.1,
    )
