"""Style of all figures, and conversion of figures to inline SVG.

The bytes of an SVG depend only on its content. Texts are stored as text, which is small and searchable.
"""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from mrdamper.report.figures.palette import (
    HELD_OUT,
    INK,
    MEASURED,
    TRAINING,
    WIDTH_INCH,
    colour_of,
    shortened,
)

__all__ = [
    "HELD_OUT",
    "INK",
    "MEASURED",
    "TRAINING",
    "WIDTH_INCH",
    "add_legend",
    "axes_table",
    "colour_of",
    "displayable",
    "drawing_style",
    "shortened",
    "svg_drawn_by",
    "svg_of",
]

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
    "legend.frameon": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#888888",
    "axes.labelcolor": INK,
    "xtick.color": "#666666",
    "ytick.color": "#666666",
    "text.color": INK,
    "axes.linewidth": 0.6,
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


@contextmanager
def drawing_style() -> Iterator[None]:
    """Set the style of all figures for a block. The browser supplies letters that the font lacks."""
    with mpl.rc_context(_STYLE), warnings.catch_warnings():  # type: ignore[arg-type]  # stubs list every key
        warnings.filterwarnings("ignore", r"Glyph \d+ .* missing from font", UserWarning)
        yield


def svg_of(figure: Figure, label: str) -> str:
    """Return the figure as an SVG element without header, dates and unused ids."""
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
    # Differences of a hundredth of a point are invisible.
    text = re.sub(r'(?<= )(d|x|y)="[^"]*"', lambda found: _DECIMALS.sub(r"\1", found[0]), text)
    escaped = re.sub(r"[^\w .,+-]", "_", label)  # A quotation mark would end the attribute.
    return text.replace("<svg", f'<svg role="img" aria-label="{escaped}"', 1)


def svg_drawn_by(draw: Callable[[], Figure], label: str) -> str:
    """Return the figure that a function draws as an SVG element."""
    with drawing_style():
        return svg_of(draw(), label)


def displayable(draw: Callable[[], Figure | None], label: str) -> Figure | None:
    """Return the figure that a function draws, which notebooks display as SVG; None if there is none."""
    with drawing_style():
        figure = draw()
    if figure is not None:
        vars(figure)["_repr_svg_"] = lambda: svg_drawn_by(lambda: figure, label)
    return figure


def axes_table(
    figure: Figure,
    rows: int,
    columns: int,
    *,
    margins: tuple[float, float, float, float],
    gaps: tuple[float, float] = (0.0, 0.0),
    share_y: bool = False,
) -> list[Axes]:
    """Return axes in rows, from the top left.

    Parameters
    ----------
    margins : left, bottom, right and top margin [inch]
    gaps : width and height of the gaps between axes [inch]
    share_y : all axes have the same limits of y; only the left ones have labels
    """
    width, height = figure.get_size_inches()
    left, bottom, right, top = margins
    across = (width - left - right - gaps[0] * (columns - 1)) / columns
    tall = (height - bottom - top - gaps[1] * (rows - 1)) / rows
    table = figure.subplots(
        rows,
        columns,
        squeeze=False,
        sharey=share_y,
        gridspec_kw={
            "left": left / width,
            "right": 1.0 - right / width,
            "bottom": bottom / height,
            "top": 1.0 - top / height,
            "wspace": gaps[0] / across,
            "hspace": gaps[1] / tall,
        },
    )
    return list(table.ravel())


def add_legend(
    figure: Figure, entries: Sequence[tuple[str, str, str]], *, title: str = "", at_top: bool = False
) -> None:
    """Add the legend of (label, colour, line style): a column at the right edge, or a row at the top."""
    if not entries:
        return
    lines = [Line2D([], [], color=colour, ls=style, lw=1.4) for _, colour, style in entries]
    figure.legend(
        lines,
        [label for label, _, _ in entries],
        loc="upper right" if at_top else "center right",
        ncols=len(entries) if at_top else 1,
        title=title or None,
        title_fontsize=7.0,
        handlelength=1.8,
        columnspacing=1.2,
        borderaxespad=0.1,
    )
