"""The problem of the finite elements as a CalculiX input: the same nodes and elements, all else its own.

CalculiX has no film coefficient that varies with temperature unless one compiles a subroutine: films are
frozen, and so are the sources. Radiation stays nonlinear. It steps by backward Euler with the step given.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.thermal.films.correlations import STEFAN_BOLTZMANN
from mrdamper.thermal.model.finite_element import FieldModel
from mrdamper.thermal.model.section import Role
from tests.oracles.programs import run_program

__all__ = ["run_calculix", "write_calculix"]


def write_calculix(
    model: FieldModel,
    films: FloatArray,
    folder: Path,
    *,
    mechanical_W: float,
    coil_W: float,
    step: float,
    steps: int,
) -> Path:
    """Write an input for CalculiX into a folder; return its path.

    Parameters
    ----------
    films : one coefficient for each of the section's laws [W/(m^2 K)]
    mechanical_W, coil_W : constant powers, spread evenly
    step, steps : of time [s], from ambient
    """
    section, mesh = model.section, model.mesh
    ambient = section.ambient
    # CalculiX reads the first 20 characters of a number
    lines = ["*NODE, NSET=NALL"]
    lines += [f"{k + 1}, {r:.12e}, {z:.12e}" for k, (r, z) in enumerate(model.nodes.tolist())]
    for number, region in enumerate(section.regions):
        inside = np.flatnonzero(mesh.region == number)
        if not inside.size:
            continue
        lines.append(f"*ELEMENT, TYPE=CAX6, ELSET=E{number}")
        lines += [f"{k + 1}, " + ", ".join(str(n + 1) for n in model.elements[k].tolist()) for k in inside]
        kr, kz = region.conductivity_r, region.conductivity_z
        lines += [
            f"*MATERIAL, NAME=M{number}",
            "*CONDUCTIVITY, TYPE=ORTHO",
            f"{kr:.12g}, {kz:.12g}, {kr:.12g}",
        ]
        lines += ["*DENSITY", "1.", "*SPECIFIC HEAT", f"{region.volumetric_heat:.12g}"]
        lines.append(f"*SOLID SECTION, ELSET=E{number}, MATERIAL=M{number}")
    lines += ["*INITIAL CONDITIONS, TYPE=TEMPERATURE", f"NALL, {ambient:.12g}"]
    lines.append(f"*PHYSICAL CONSTANTS, ABSOLUTE ZERO=0, STEFAN BOLTZMANN={STEFAN_BOLTZMANN:.12g}")
    lines += [f"*STEP, INC={steps + 1}", "*HEAT TRANSFER, DIRECT", f"{step:.12g}, {step * steps:.12g}"]
    lines += ["*DFLUX", *_sources(model, "gap", mechanical_W), *_sources(model, "coil", coil_W)]
    faces = _faces(model)
    films_of, radiation_of = ["*FILM"], ["*RADIATE"]
    for (element, face), number in faces:
        surface = section.surfaces[number]
        film = float(films[surface.law]) + surface.mount
        films_of.append(f"{element + 1}, F{face + 1}, {ambient:.12g}, {film:.12g}")
        if surface.emissivity > 0.0:
            radiation_of.append(f"{element + 1}, R{face + 1}, {ambient:.12g}, {surface.emissivity:.12g}")
    lines += films_of
    lines += radiation_of if len(radiation_of) > 1 else []
    lines += [f"*NODE PRINT, NSET=NALL, FREQUENCY={steps}", "NT", "*END STEP"]
    path = folder / "section.inp"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def run_calculix(path: Path, nodes: int) -> FloatArray:
    """Run an input of ``write_calculix``; return its nodes' temperatures at the end [K], shape (nodes,).

    Raises
    ------
    InputError
        CalculiX is not installed, or failed.
    """
    said = run_program("ccx", ["-i", path.stem], path.parent, package="calculix-ccx")
    found = np.full(nodes, math.nan)
    results = path.with_suffix(".dat")
    blocks = results.read_text(encoding="utf-8").split("temperatures") if results.is_file() else []
    for line in blocks[-1].splitlines()[1:] if blocks else []:
        words = line.split()
        if len(words) == 2 and words[0].isdigit() and int(words[0]) <= nodes:
            found[int(words[0]) - 1] = float(words[1])
    if np.isnan(found).any():
        raise InputError(f"CalculiX gave no temperature for every node of {path}: {said.strip()[-600:]}")
    return found


def _sources(model: FieldModel, role: Role, power: float) -> list[str]:
    """Return the body fluxes that spread a power over the regions with a role."""
    numbers = [k for k, region in enumerate(model.section.regions) if region.role == role]
    volume = float(model.mesh.volumes()[np.isin(model.mesh.region, numbers)].sum())
    return [
        f"E{k}, BF, {power / volume:.12g}" for k in numbers if (model.mesh.region == k).any() and power != 0.0
    ]


def _faces(model: FieldModel) -> list[tuple[tuple[int, int], int]]:
    """Return the element and its side (0: 01, 1: 12, 2: 20) of each facet, and the facet's surface."""
    where: dict[tuple[int, int], tuple[int, int]] = {}
    for side, (a, b) in enumerate(((0, 1), (1, 2), (2, 0))):
        ends = np.sort(model.mesh.triangles[:, [a, b]], axis=1)
        where |= {(int(p), int(q)): (k, side) for k, (p, q) in enumerate(ends)}
    facets = np.sort(model.mesh.facets, axis=1).tolist()
    return [(where[p, q], int(s)) for (p, q), s in zip(facets, model.mesh.surface, strict=True)]
