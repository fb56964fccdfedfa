"""Section of a damper along its axis, to scale, with fins or with the temperature field.

The section is the domain of the finite elements, mirrored about the axis. Both axes are in millimetres.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from types import MappingProxyType
from typing import TYPE_CHECKING

from matplotlib import colormaps
from matplotlib.colors import BoundaryNorm, to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import Triangulation

from mrdamper.arrays import FloatArray
from mrdamper.report.figures.style import INK, WIDTH_INCH, drawing_style, svg_of
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.model.mesh import SectionMesh
from mrdamper.thermal.model.section import Section, section_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLOURS: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "core": ("#8d949b", "rod, piston"),
        "coil": ("#c98343", "coil"),
        "gap": ("#8fb6cf", "fluid"),
        "chamber": ("#8fb6cf", "fluid"),
        "wall": ("#5c646c", "body"),
        "fins": ("#c3cad1", "fins"),
    }
)
SHOWN_ROD_RATIO = 0.08  # Each rod is cut at this fraction of the body length beyond the cap.
HEIGHT_MAX_INCH = 3.4


def draw_dampers(dampers: Sequence[tuple[str, DamperDrawing]], label: str) -> str:
    """Return dampers as SVG, given as (title, geometry), with the same scale, side by side or stacked."""
    across, along = _extent([drawing for _, drawing in dampers])
    columns = min(len(dampers), 2)
    rows = -(-len(dampers) // columns)
    left, right, bottom, gap = 0.45, 0.12, 0.62, 0.35  # inches
    top = 0.4 if any("\n" in title for title, _ in dampers) else 0.26
    inch = (WIDTH_INCH - left - right - gap * (columns - 1)) / columns / along
    inch = min(inch, HEIGHT_MAX_INCH / (2.0 * across))
    wide, high = along * inch, 2.0 * across * inch
    width = left + right + columns * wide + (columns - 1) * gap
    height = rows * (high + top) + (rows - 1) * 0.3 + bottom
    with drawing_style():
        figure = Figure(figsize=(width, height))
        for place, (title, drawing) in enumerate(dampers):
            row, column = divmod(place, columns)
            x = (left + column * (wide + gap)) / width
            y = 1.0 - (top * (row + 1) + (high + 0.3) * row + high) / height
            axes = figure.add_axes((x, y, wide / width, high / height))
            _draw(axes, section_of(drawing), drawing)
            _frame(axes, across, along)
            axes.set_title(title, loc="left", pad=3)
            if column:
                axes.tick_params(axis="y", labelleft=False)
            if row == rows - 1 or place + columns >= len(dampers):
                axes.set_xlabel("mm", labelpad=1.0)
            else:
                axes.tick_params(axis="x", labelbottom=False)
        keys = {word: colour for colour, word in _COLOURS.values()}
        if not any(drawing.sink for _, drawing in dampers):
            keys.pop("fins")
        patches = [Patch(facecolor=colour, label=word) for word, colour in keys.items()]
        figure.legend(
            handles=patches,
            loc="lower left",
            ncols=len(patches),
            bbox_to_anchor=(left / width, 0.0),
            borderaxespad=0.2,
        )
        return svg_of(figure, label)


def draw_field(section: Section, mesh: SectionMesh, celsius: FloatArray, label: str) -> str:
    """Return the temperatures at the corners of a mesh [degC] as bands of equal temperature."""
    corners = mesh.corners
    across = 1e3 * float(corners[:, 0].max()) * 1.06
    along = 1e3 * float(corners[:, 1].max())
    left, right, top, bottom = 0.45, 0.95, 0.22, 0.42
    inch = min((WIDTH_INCH - left - right) / (1.06 * along), HEIGHT_MAX_INCH / (2.0 * across))
    wide, high = 1.06 * along * inch, 2.0 * across * inch
    width, height = left + wide + right, top + high + bottom
    levels = MaxNLocator(nbins=14, steps=[1, 2, 2.5, 5, 10]).tick_values(celsius.min(), celsius.max())
    map_ = colormaps["inferno"]
    with drawing_style():
        figure = Figure(figsize=(width, height))
        axes = figure.add_axes((left / width, bottom / height, wide / width, high / height))
        z, r = 1e3 * corners[:, 1], 1e3 * corners[:, 0]
        norm = BoundaryNorm(levels, map_.N)
        for side in (1.0, -1.0):
            at = Triangulation(z, side * r, mesh.triangles)
            axes.tricontourf(at, celsius, levels=levels, cmap=map_, norm=norm)
        for block in section.blocks:
            for side in (1.0, -1.0):
                low = 1e3 * (block.inner if side > 0.0 else -block.outer)
                size = (1e3 * (block.high - block.low), 1e3 * (block.outer - block.inner))
                axes.add_patch(
                    Rectangle((1e3 * block.low, low), *size, fill=False, edgecolor="white", linewidth=0.25)
                )
        axes.set_xlim(-0.03 * along, 1.03 * along)
        axes.set_ylim(-across, across)
        axes.grid(visible=False)
        axes.set_xlabel("mm", labelpad=1.0)
        bar = figure.add_axes(((left + wide + 0.12) / width, bottom / height, 0.14 / width, high / height))
        for low, high_level in pairwise(levels):
            colour = to_hex(map_(norm(0.5 * (low + high_level))))
            bar.axhspan(low, high_level, color=colour, linewidth=0)
        bar.set_ylim(levels[0], levels[-1])
        bar.set_xticks([])
        bar.yaxis.tick_right()
        bar.grid(visible=False)
        bar.set_title("°C", pad=3)
        return svg_of(figure, label)


def _extent(drawings: Sequence[DamperDrawing]) -> tuple[float, float]:
    """Return half the height and the length that fit all dampers [mm]."""
    tips = [
        d.sink.tip_radius(d.body.outer_diameter) if d.sink else 0.5 * d.body.outer_diameter for d in drawings
    ]
    lengths = [d.body.length * (1.0 + 2.0 * SHOWN_ROD_RATIO) for d in drawings]
    return 1e3 * max(tips) * 1.06, 1e3 * max(lengths) * 1.02


def _frame(axes: Axes, across: float, along: float) -> None:
    middle = along / (2.0 * 1.02 * (1.0 + 2.0 * SHOWN_ROD_RATIO))
    axes.set_xlim(middle - 0.5 * along, middle + 0.5 * along)
    axes.set_ylim(-across, across)
    axes.set_aspect("equal")
    axes.axhline(0.0, color=INK, linewidth=0.5, linestyle=(0, (8, 3, 2, 3)))


def _draw(axes: Axes, section: Section, drawing: DamperDrawing) -> None:
    """Draw the blocks of a section, their mirror images, and the visible part of the rod."""
    for block in section.blocks:
        colour = _COLOURS[section.regions[block.region].role][0]
        for low in (block.inner, -block.outer):
            _ring(axes, block.low, block.high, low, block.outer - block.inner, colour)
    shaft, length = 0.5 * drawing.rod.diameter, drawing.body.length
    ends = [(-SHOWN_ROD_RATIO * length, 0.0)]
    if drawing.rod.through:
        ends.append((length, (1.0 + SHOWN_ROD_RATIO) * length))
    for start, stop in ends:
        _ring(axes, start, stop, -shaft, 2.0 * shaft, _COLOURS["core"][0])


def _ring(axes: Axes, start: float, stop: float, low: float, high: float, colour: str) -> None:
    axes.add_patch(
        Rectangle(
            (1e3 * start, 1e3 * low),
            1e3 * (stop - start),
            1e3 * high,
            facecolor=colour,
            edgecolor=colour,
            linewidth=0.2,
        )
    )
