"""A mesh of a section by gmsh: its own nodes, its own way of finding which line is which surface.

Rectangles are joined by its OpenCASCADE kernel and lines are picked by bounding boxes, so that a fault in our
mesh or in its tags would show as a difference.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mrdamper.errors import InputError
from mrdamper.thermal.model.mesh import SectionMesh
from mrdamper.thermal.model.section import Section
from tests.oracles.programs import run_program

__all__ = ["mesh_with_gmsh", "read_gmsh", "write_geometry"]

_SLACK = 1e-6  # about a bounding box [m]
_LINE, _TRIANGLE = 1, 2


def mesh_with_gmsh(
    section: Section, folder: Path, *, size: float = 0.008, corner: float = 0.0005
) -> SectionMesh:
    """Return a mesh of a section that gmsh made.

    Parameters
    ----------
    size, corner : sides of triangles at most, and at the corners of the blocks [m]

    Raises
    ------
    InputError
        gmsh is not installed, or failed.
    """
    geometry = folder / "section.geo"
    write_geometry(section, geometry, size=size, corner=corner)
    run_program("gmsh", ["-2", "-format", "msh22", "-o", "gmsh.msh", geometry.name], folder, package="gmsh")
    return read_gmsh(folder / "gmsh.msh")


def write_geometry(section: Section, path: Path, *, size: float, corner: float) -> None:
    """Write a section as a gmsh script, with cells of a size [m], smaller at corners [m]."""
    lines = ['SetFactory("OpenCASCADE");', f"Mesh.CharacteristicLengthMax = {size:.12g};"]
    for number, block in enumerate(section.blocks, start=1):
        width, height = block.outer - block.inner, block.high - block.low
        lines.append(
            f"Rectangle({number}) = {{{block.inner:.15g}, {block.low:.15g}, 0, {width:.15g}, {height:.15g}}};"
        )
    lines += ["Coherence;", f"MeshSize {{ PointsOf {{ Surface{{:}}; }} }} = {corner:.12g};"]
    for number in range(len(section.regions)):
        chosen = [str(k) for k, block in enumerate(section.blocks, start=1) if block.region == number]
        if chosen:
            lines.append(f"Physical Surface({number + 1}) = {{{', '.join(chosen)}}};")
    for number in range(len(section.surfaces)):
        lines.append("found[] = {};")
        for edge in section.edges:
            if edge.surface == number:
                low = f"{edge.inner - _SLACK:.12g}, {edge.low - _SLACK:.12g}, {-_SLACK:g}"
                high = f"{edge.outer + _SLACK:.12g}, {edge.high + _SLACK:.12g}, {_SLACK:g}"
                lines.append(f"found[] += Curve In BoundingBox {{{low}, {high}}};")
        lines.append(f"Physical Curve({number + 1}) = {{found[]}};")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def read_gmsh(path: Path) -> SectionMesh:
    """Return the mesh in a gmsh file of format 2.2; its tags are regions and surfaces, from 1."""
    lines = iter(path.read_text(encoding="utf-8").splitlines())
    nodes: dict[int, tuple[float, float]] = {}
    triangles, region, facets, surface = [], [], [], []
    for line in lines:
        if line == "$Nodes":
            for _ in range(int(next(lines))):
                number, r, z, _height = next(lines).split()
                nodes[int(number)] = (float(r), float(z))
        elif line == "$Elements":
            for _ in range(int(next(lines))):
                words = [int(word) for word in next(lines).split()]
                ends = words[3 + words[2] :]
                if words[1] == _TRIANGLE:
                    triangles.append(ends)
                    region.append(words[3] - 1)
                elif words[1] == _LINE:
                    facets.append(ends)
                    surface.append(words[3] - 1)
    if not triangles:
        raise InputError(f"{path.name}: there are no triangles in it; expected a gmsh mesh of format 2.2")
    used, compact = np.unique(triangles, return_inverse=True)
    corners = np.array([nodes[int(k)] for k in used])
    found = compact.reshape(-1, 3)
    a, b, c = (corners[found[:, k]] for k in range(3))
    clockwise = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) < (c[:, 0] - a[:, 0]) * (b[:, 1] - a[:, 1])
    found[clockwise] = found[clockwise][:, ::-1]
    return SectionMesh(
        corners,
        found,
        np.array(region, dtype=np.int64),
        np.searchsorted(used, np.array(facets, dtype=np.int64).reshape(-1, 2)),
        np.array(surface, dtype=np.int64),
    )
