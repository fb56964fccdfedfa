"""Triangle meshes of the meridian section of a damper, refined at corners.

The section consists of rectangles (blocks) of material. The mesh starts as a grid with lines along all sides
of the rectangles. The heat flux is singular at points that touch three materials, and at the roots of fins.
All triangle sides that meet in such a point are divided repeatedly. This refinement needs few nodes and
creates no hanging nodes. A facet is a side of a triangle on the surface of the damper.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray, read_only
from mrdamper.errors import InputError
from mrdamper.thermal.model.section import Edge, Section

IntArray = NDArray[np.int64]

SIDE_TOLERANCE_M = 1e-9  # Sides of rectangles with a smaller distance count as one side.
CUT_RATIO = 0.35  # A side of a triangle is cut at this fraction of its length from the refined corner.
EDGE_CELL_RATIO = 0.15  # size of cells next to a boundary of a material / maximum cell size
CELL_GROWTH_RATIO = 1.0  # increase of the cell size / distance from the boundary of a material
FIRST_CELL_RATIO_MAX = 0.2  # max radial size of a cell next to a boundary / radial width of the material
# The gap conducts much better along z than along r. Therefore the heat flow turns near its walls, and the
# cells must be smaller there.
GAP_FIRST_CELL_RATIO_MAX = 0.05
AXIAL_CELL_RATIO_MAX = 1.0  # max axial size of a cell next to a boundary / axial length of the material
SAMPLE_COUNT = 129  # number of points between two boundaries at which the cell size is evaluated


@dataclass(frozen=True, slots=True, eq=False)
class SectionMesh:
    """Counterclockwise triangles in the plane (r, z), and the facets of the outline that lose heat."""

    corners: FloatArray  # coordinates (r, z) [m], shape (c, 2)
    triangles: IntArray  # indices of the corners of each triangle, shape (t, 3)
    region: IntArray  # index of the region of each triangle, shape (t,)
    facets: IntArray  # indices of the corners of each facet, shape (f, 2)
    surface: IntArray  # index of the surface of each facet, shape (f,)

    def __post_init__(self) -> None:
        object.__setattr__(self, "corners", read_only(self.corners))
        for name in ("triangles", "region", "facets", "surface"):
            array = np.array(getattr(self, name), dtype=np.int64)
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def doubled_areas(self) -> FloatArray:
        """Return twice the area of each triangle [m^2], positive if counterclockwise."""
        a, b, c = (self.corners[self.triangles[:, k]] for k in range(3))
        return np.asarray(
            (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (c[:, 0] - a[:, 0]) * (b[:, 1] - a[:, 1])
        )

    def volumes(self) -> FloatArray:
        """Return the volume of each triangle rotated about the axis [m^3]."""
        return np.asarray(math.pi * self.doubled_areas() * self.corners[self.triangles, 0].mean(axis=1))

    def areas(self) -> FloatArray:
        """Return the area of each facet rotated about the axis [m^2]."""
        ends = self.corners[self.facets]
        length = np.hypot(*(ends[:, 1] - ends[:, 0]).T)
        return np.asarray(2.0 * math.pi * length * ends[:, :, 0].mean(axis=1))


def mesh_section(section: Section, size: float = 0.008, *, levels: int = 3) -> SectionMesh:
    """Return a triangle mesh of a section. A symmetric section has a symmetric mesh.

    Parameters
    ----------
    size : maximum side of a cell along r or z [m]; cells next to boundaries of materials are smaller
    levels : number of refinements at each corner of the blocks

    Raises
    ------
    InputError
        If blocks overlap, or if an edge that loses heat is not on the outline of the blocks.
    """
    if not (math.isfinite(size) and size > 0.0):
        raise InputError(place="mesh", found=f"size is {size} m", expected="a positive, finite number")
    gaps = [block for block in section.blocks if section.regions[block.region].role == "gap"]

    def radial_share(radius: float) -> float:
        return (
            GAP_FIRST_CELL_RATIO_MAX
            if any(gap.inner < radius < gap.outer for gap in gaps)
            else FIRST_CELL_RATIO_MAX
        )

    radii = _lines([r for block in section.blocks for r in (block.inner, block.outer)], size, radial_share)
    heights = _lines(
        [z for block in section.blocks for z in (block.low, block.high)],
        size,
        lambda _height: AXIAL_CELL_RATIO_MAX,
    )
    region = np.full((len(radii) - 1, len(heights) - 1), -1, dtype=np.int64)
    for block in section.blocks:
        cells = region[_cells(radii, block.inner, block.outer), _cells(heights, block.low, block.high)]
        if (cells != -1).any():
            raise InputError(
                place="section",
                found=f"a block of {section.regions[block.region].name!r} overlaps another one",
            )
        cells[...] = block.region
    i, j = np.nonzero(region >= 0)
    across = len(heights)
    low_in, low_out = i * across + j, (i + 1) * across + j
    high_in, high_out = low_in + 1, low_out + 1
    # The diagonals above the middle of the section have the opposite direction. Then a symmetric section
    # has a symmetric mesh.
    rising = heights[j] + heights[j + 1] < heights[0] + heights[-1]
    first = np.where(rising, [low_in, low_out, high_out], [low_in, low_out, high_in]).T
    second = np.where(rising, [low_in, high_out, high_in], [low_out, high_out, high_in]).T
    nodes = np.stack(np.meshgrid(radii, heights, indexing="ij"), axis=-1).reshape(-1, 2)
    facets, surface = _facets(section.edges, radii, heights)
    grid = _Triangles(nodes, np.concatenate([first, second]), np.tile(region[i, j], 2), facets, surface)
    for corner in _corners(region):
        for _ in range(levels):
            grid.cut_around(corner)
    return grid.mesh()


class _Triangles:
    """A mesh during its refinement, which can contain unused nodes."""

    def __init__(
        self, nodes: FloatArray, triangles: IntArray, region: IntArray, facets: IntArray, surface: IntArray
    ) -> None:
        self.nodes, self.triangles, self.region = nodes, triangles, region
        self.facets, self.surface = facets, surface

    def cut_around(self, corner: int) -> None:
        """Cut all sides that meet in a node, and divide each triangle there into three."""
        at, place = np.nonzero(self.triangles == corner)
        ring = self.triangles[at]
        a, b = ring[np.arange(len(at)), (place + 1) % 3], ring[np.arange(len(at)), (place + 2) % 3]
        far, which = np.unique(np.concatenate([a, b]), return_inverse=True)
        near = len(self.nodes) + np.arange(len(far))
        new_a, new_b = near[which].reshape(2, -1)
        self.nodes = np.concatenate(
            [self.nodes, self.nodes[corner] + CUT_RATIO * (self.nodes[far] - self.nodes[corner])]
        )
        # The cut leaves a quadrilateral, which is divided along its shorter diagonal. If the diagonals have
        # equal lengths, the diagonal closer to the axis is used.
        diagonal = np.hypot(*(self.nodes[new_a] - self.nodes[b]).T) - np.hypot(
            *(self.nodes[a] - self.nodes[new_b]).T
        )
        tie = np.abs(diagonal) < SIDE_TOLERANCE_M
        falls = np.where(tie, self.nodes[new_a, 0] < self.nodes[new_b, 0], diagonal < 0.0)
        third = np.where(falls, b, new_b)
        fourth = np.where(falls, new_a, a)
        tip = np.full(len(at), corner)
        self.triangles = np.concatenate(
            [
                np.delete(self.triangles, at, axis=0),
                np.stack([tip, new_a, new_b], axis=1),
                np.stack([new_a, a, third], axis=1),
                np.stack([fourth, b, new_b], axis=1),
            ]
        )
        self.region = np.concatenate([np.delete(self.region, at), np.tile(self.region[at], 3)])
        for side in (0, 1):
            touching = np.flatnonzero(self.facets[:, side] == corner)
            other = self.facets[touching, 1 - side]
            cut = near[np.searchsorted(far, other)]
            self.facets[touching, 1 - side] = cut
            self.facets = np.concatenate([self.facets, np.stack([cut, other], axis=1)])
            self.surface = np.concatenate([self.surface, self.surface[touching]])

    def mesh(self) -> SectionMesh:
        used, compact = np.unique(self.triangles, return_inverse=True)
        if not np.isin(self.facets, used).all():
            raise InputError(place="section", found="an edge lies outside all blocks")
        return SectionMesh(
            self.nodes[used],
            compact.reshape(-1, 3),
            self.region,
            np.searchsorted(used, self.facets),
            self.surface,
        )


def _corners(region: IntArray) -> list[int]:
    """Return the grid nodes at corners of regions, without convex outer corners.

    A node is followed by its mirror image, so that the refinement of a symmetric grid is symmetric.
    """
    padded = np.pad(region, 1, constant_values=-1)
    quarters = np.stack([padded[:-1, :-1], padded[1:, :-1], padded[:-1, 1:], padded[1:, 1:]])
    straight = (quarters[0] == quarters[1]) & (quarters[2] == quarters[3])
    straight |= (quarters[0] == quarters[2]) & (quarters[1] == quarters[3])
    i, j = np.nonzero(~straight & ((quarters == -1).sum(axis=0) <= 1))
    across = region.shape[1] + 1
    order = np.lexsort((j, np.abs(2 * j - region.shape[1]), i))
    return [int(node) for node in (i * across + j)[order]]


def _lines(sides: list[float], size: float, share_at: Callable[[float], float]) -> FloatArray:
    """Return the positions of grid lines at the sides of blocks and between the sides.

    The lines between two sides divide the distance into cells, which grow from the sides towards the middle.
    The cells next to a side are limited to a fraction of the distance. ``share_at`` returns this fraction for
    the position of the middle. Sides that differ by less than the tolerance are merged.
    """
    ordered = np.unique(sides)
    distinct = ordered[np.concatenate([[True], np.diff(ordered) > SIDE_TOLERANCE_M])]
    pieces = []
    for start, stop in pairwise(distinct.tolist()):
        at, share = np.linspace(start, stop, SAMPLE_COUNT), share_at(0.5 * (start + stop))
        wanted = np.minimum(
            size,
            min(EDGE_CELL_RATIO * size, share * (stop - start))
            + CELL_GROWTH_RATIO * np.minimum(at - start, stop - at),
        )
        cells = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(at) * (1.0 / wanted[1:] + 1.0 / wanted[:-1]))])
        count = max(1, math.ceil(cells[-1] - 1e-6))
        if abs(start + stop - distinct[0] - distinct[-1]) < SIDE_TOLERANCE_M:
            count += count % 2  # No cell may cross the middle, because diagonals change direction there.
        pieces.append(np.interp(np.arange(count) * (cells[-1] / count), cells, at))
    return np.concatenate([*pieces, distinct[-1:]])


def _cells(lines: FloatArray, low: float, high: float) -> slice:
    """Return the slice of the grid cells between two sides of a block."""
    return slice(_line(lines, low), _line(lines, high))


def _line(lines: FloatArray, side: float) -> int:
    found = int(np.abs(lines - side).argmin())
    if abs(lines[found] - side) > 2.0 * SIDE_TOLERANCE_M:
        raise InputError(
            place="section",
            found=f"an edge has an end at {side:g} m, which is not a side or a corner of a block",
        )
    return found


def _facets(edges: tuple[Edge, ...], radii: FloatArray, heights: FloatArray) -> tuple[IntArray, IntArray]:
    """Return the facets of all edges, each as two grid nodes, and the surface index of every facet."""
    across = len(heights)
    found, surface = [], []
    for edge in edges:
        r, z = _cells(radii, edge.inner, edge.outer), _cells(heights, edge.low, edge.high)
        if r.start == r.stop:
            nodes = r.start * across + np.arange(z.start, z.stop + 1)
        else:
            nodes = np.arange(r.start, r.stop + 1) * across + z.start
        found.append(np.stack([nodes[:-1], nodes[1:]], axis=1))
        surface.append(np.full(len(nodes) - 1, edge.surface))
    if not found:
        return np.zeros((0, 2), dtype=np.int64), np.zeros(0, dtype=np.int64)
    return np.concatenate(found), np.concatenate(surface)
