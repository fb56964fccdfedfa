"""The style of figures that Matplotlib draws, as inline SVG, and sheets drawn by it.

An SVG's bytes depend on what is drawn alone. Text stays text (small, searchable).
"""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

import matplotlib as mpl
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from mrdamper.report.figures.palette import HELD_OUT, INK, MEASURED, TRAINING, WIDE, colour_of, shortened

__all__ = [
    "HELD_OUT",
    "INK",
    "MEASURED",
    "TRAINING",
    "WIDE",
    "colour_of",
    "drawing_style",
    "shortened",
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
    "path.simplify": True,
    "path.simplify_threshold": 0.1,
}


@contextmanager
def drawing_style() -> Iterator[None]:
    """Give the context in which every figure is drawn; letters that its font lacks are the browser's."""
    with mpl.rc_context(_STYLE), warnings.catch_warnings():  # type: ignore[arg-type]  # stubs list every key
        warnings.filterwarnings("ignore", r"Glyph \d+ .* missing from font", UserWarning)
        yield


def svg_of(figure: Figure, label: str) -> str:
    """Return the figure as an SVG element without header, dates and ids that nothing refers to."""
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
    # a hundredth of a point is less than anyone sees
    text = re.sub(r'(?<= )(d|x|y)="[^"]*"', lambda found: _DECIMALS.sub(r"\1", found[0]), text)
    said = re.sub(r"[^\w .,+-]", "_", label)  # an attribute: nothing in it may end it
    return text.replace("<svg", f'<svg role="img" aria-label="{said}"', 1)
