"""Section of a damper along its axis, to scale, with fins or with the temperature field.

The section is the domain of the finite elements, mirrored about the axis. Both axes are in millimetres.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import Triangulation

from mrdamper.arrays import FloatArray
from mrdamper.report.figures.style import DASHED, INK, WIDTH_INCH
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.model.mesh import SectionMesh
from mrdamper.thermal.model.section import Block, Section, section_of

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
MARGIN_INCH, TITLE_INCH = 0.45, 0.4


def dampers_figure(dampers: Sequence[tuple[str, DamperDrawing]]) -> Figure:
    """Return a figure of several dampers (title, geometry) at the same scale, two in a row."""
    across = 1.06e3 * max(
        d.sink.tip_radius(d.body.outer_diameter) if d.sink else 0.5 * d.body.outer_diameter
        for _, d in dampers
    )
    along = 1.02e3 * max(d.body.length * (1.0 + 2.0 * SHOWN_ROD_RATIO) for _, d in dampers)
    columns = min(len(dampers), 2)
    rows = -(-len(dampers) // columns)
    wide = WIDTH_INCH / columns - MARGIN_INCH
    high = min(wide * 2.0 * across / along, 3.4)
    height = rows * (high + TITLE_INCH + MARGIN_INCH) + MARGIN_INCH
    figure = Figure(figsize=(WIDTH_INCH, height))
    for place, (title, drawing) in enumerate(dampers):
        row, column = divmod(place, columns)
        x, y = (
            MARGIN_INCH + column * (wide + MARGIN_INCH),
            (row + 1) * (high + TITLE_INCH) + row * MARGIN_INCH,
        )
        axes = figure.add_axes((x / WIDTH_INCH, 1.0 - y / height, wide / WIDTH_INCH, high / height))
        axes.set_aspect("equal", anchor="W")
        _draw(axes, drawing)
        middle = 0.5e3 * drawing.body.length
        axes.set(xlim=(middle - 0.5 * along, middle + 0.5 * along), ylim=(-across, across), xlabel="mm")
        axes.axhline(0.0, color=INK, lw=0.5, ls=DASHED)
        axes.set_title(title)
    keys = {word: colour for colour, word in _COLOURS.values()}
    if not any(drawing.sink for _, drawing in dampers):
        keys.pop("fins")
    patches = [Patch(facecolor=colour, label=word) for word, colour in keys.items()]
    figure.legend(handles=patches, loc="lower left", ncols=len(patches))
    return figure


def field_figure(section: Section, mesh: SectionMesh, celsius: FloatArray) -> Figure:
    """Return a figure of the temperature field; temperatures are at ``mesh.corners``."""
    r, z = (1e3 * mesh.corners[:, k] for k in (0, 1))
    figure = Figure(figsize=(WIDTH_INCH, 3.6), layout="constrained")
    axes = figure.subplots()
    axes.set_aspect("equal")
    levels = MaxNLocator(nbins=14, steps=[1, 2, 2.5, 5, 10]).tick_values(celsius.min(), celsius.max())
    bands: Any = None
    for side in (1.0, -1.0):
        bands = axes.tricontourf(Triangulation(z, side * r, mesh.triangles), celsius, levels, cmap="inferno")
    for block in section.blocks:
        _add_ring(axes, block, fill=False, edgecolor="white", linewidth=0.25)
    axes.grid(visible=False)
    axes.set_xlabel("mm")
    figure.colorbar(bands, ax=axes, pad=0.01, aspect=25, label="°C")
    return figure


def _draw(axes: Axes, drawing: DamperDrawing) -> None:
    """Draw the section of a damper, mirrored about its axis."""
    section = section_of(drawing)
    for block in section.blocks:
        _add_ring(axes, block, color=_COLOURS[section.regions[block.region].role][0], linewidth=0.2)
    shaft, length = 0.5 * drawing.rod.diameter, drawing.body.length
    ends = [(-SHOWN_ROD_RATIO * length, 0.0), (length, (1.0 + SHOWN_ROD_RATIO) * length)]
    for start, stop in ends[: 1 + drawing.rod.through]:
        _add_ring(axes, Block(0, 0.0, shaft, start, stop), color=_COLOURS["core"][0], linewidth=0.2)


def _add_ring(axes: Axes, block: Block, **style: object) -> None:
    """Draw a ring of material as two rectangles, one on each side of the axis."""
    wide, high = 1e3 * (block.high - block.low), 1e3 * (block.outer - block.inner)
    for low in (block.inner, -block.outer):
        axes.add_patch(Rectangle((1e3 * block.low, 1e3 * low), wide, high, **style))  # type: ignore[arg-type]
