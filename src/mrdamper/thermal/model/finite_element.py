"""Finite elements: transient heat in the meridian section of a damper, fins and all.

Axisymmetric, quadratic triangles (scikit-fem, extra ``[thermal]``), radiation and film coefficients at the
surface's own temperature point by point, sources at the running temperature. What is solved is ``section``'s,
how it goes through time ``heat_equation``'s. The network is fast, this is the judge.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError, MissingExtraError
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.materials import COPPER_PER_K
from mrdamper.thermal.model.heat_equation import Cooling, FieldHeating, HeatEquation, simulate_field
from mrdamper.thermal.model.mesh import IntArray, SectionMesh, mesh_section
from mrdamper.thermal.model.network import PATHS
from mrdamper.thermal.model.section import Role, Section, section_of
from mrdamper.thermal.model.stepping import Load

__all__ = ["FieldModel", "build_field", "discretise", "heat_field"]

_INTEGRATION = 5  # exact for r times the product of two quadratics
_FACET_POINTS = 3


@dataclass(frozen=True, slots=True, eq=False)
class FieldModel:
    """A section, its mesh, and the heat equation on the mesh's nodes.

    The unknowns are temperatures at ``nodes``: the corners first, in the mesh's order, then the middles of
    the sides. ``elements`` names the six nodes of each triangle: corners, then the middles of the sides 01,
    12 and 02.
    """

    section: Section
    mesh: SectionMesh
    nodes: FloatArray  # (r, z) [m], shape (n, 2)
    elements: IntArray  # shape (t, 6)
    equation: HeatEquation
    surface: IntArray  # of each of the equation's surface points, shape (p,)


def build_field(drawing: DamperDrawing, *, size: float = 0.008) -> FieldModel:
    """Return the finite-element model of a drawing.

    Parameters
    ----------
    size : longest side of a cell [m]

    Raises
    ------
    MissingExtraError
        scikit-fem is not installed.
    """
    section = section_of(drawing)
    return discretise(section, mesh_section(section, size))


def heat_field(
    drawing: DamperDrawing,
    loads: Sequence[Load],
    *,
    size: float = 0.008,
    start_K: float | None = None,
    longest_step: float = 60.0,
    stop_at: float = math.inf,
) -> tuple[FieldModel, FieldHeating]:
    """Return the model of a drawing and its course through loads; see ``heat_equation.simulate_field``.

    Parameters
    ----------
    size : of a cell of the mesh, at most [m]
    start_K : temperature of everything at the start [K]; None: ambient
    longest_step : of time [s]
    stop_at : temperature of the fluid at which the course ends [K]
    """
    model = build_field(drawing, size=size)
    course = simulate_field(model.equation, loads, start=start_K, longest_step=longest_step, stop_at=stop_at)
    return model, course


def discretise(section: Section, mesh: SectionMesh) -> FieldModel:
    """Return the finite-element model of a section on a mesh of it."""
    try:
        import skfem
    except ImportError as error:
        raise MissingExtraError.of("the finite-element model", "scikit-fem", "thermal") from error
    triangles = skfem.MeshTri(mesh.corners.T.copy(), mesh.triangles.T.copy(), sort_t=False)
    basis = skfem.Basis(triangles, skfem.ElementTriP2(), intorder=_INTEGRATION)
    elements = np.ascontiguousarray(basis.element_dofs.T)
    values = np.stack([np.asarray(basis.basis[k][0]) for k in range(6)])  # (6, t or 1, q)
    gradients = np.stack([np.asarray(basis.basis[k][0].grad) for k in range(6)])  # (6, 2, t, q)
    weights = basis.dx * 2.0 * math.pi * np.asarray(basis.global_coordinates())[0]  # (t, q)
    heat = np.array([region.volumetric_heat for region in section.regions])[mesh.region]
    along = np.array([(region.conductivity_r, region.conductivity_z) for region in section.regions])[
        mesh.region
    ]
    size = int(basis.N)

    def assembled(local: FloatArray) -> sparse.csr_array:
        rows, columns = np.repeat(elements, 6, axis=1), np.tile(elements, 6)
        return sparse.csr_array((local.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size))

    shapes = np.einsum("itq,jtq,tq->tij", *(np.broadcast_to(values, (6, *weights.shape)),) * 2, weights)
    conduction = np.einsum("idtq,jdtq,td,tq->tij", gradients, gradients, along, weights, optimize=True)
    loads = np.einsum("itq,tq->ti", np.broadcast_to(values, (6, *weights.shape)), weights)

    def mean_over(*roles: Role) -> FloatArray:
        """Return the row that takes the mean over regions, which is also a load of 1 W spread over them."""
        inside = _with_roles(section, mesh, roles)
        row = np.bincount(elements[inside].ravel(), loads[inside].ravel(), size)
        return np.asarray(row / row.sum()) if inside.any() else np.zeros(size)

    in_coil = _with_roles(section, mesh, ("coil",))
    coil_volume = float(weights[in_coil].sum()) if in_coil.any() else 1.0
    surface, area, which = _surface_points(mesh, elements, size)
    coil = mean_over("coil")
    equation = HeatEquation(
        ambient=section.ambient,
        mass=assembled(shapes * heat[:, None, None]),
        stiffness=assembled(conduction),
        mechanical=mean_over("gap"),
        electrical=coil,
        warming=assembled(shapes * (COPPER_PER_K / coil_volume * in_coil)[:, None, None]),
        surface=surface,
        area=area,
        cooling=_cooling(section, which),
        fluid=mean_over("gap", "chamber"),
        coil=coil,
        wall=mean_over("wall"),
        uniform=np.ones(size),
        reference_growth=1.0 + COPPER_PER_K * (section.ambient - 293.15),
    )
    return FieldModel(section, mesh, np.asarray(basis.doflocs).T.copy(), elements, equation, which)


def _with_roles(section: Section, mesh: SectionMesh, roles: Sequence[Role]) -> NDArray[np.bool_]:
    return np.isin(mesh.region, [k for k, region in enumerate(section.regions) if region.role in roles])


def _surface_points(
    mesh: SectionMesh, elements: IntArray, size: int
) -> tuple[sparse.csr_array, FloatArray, IntArray]:
    """Return Gauss points on the facets: values there, their areas and the surface each lies on."""
    ends = np.sort(
        np.concatenate([mesh.triangles[:, [0, 1]], mesh.triangles[:, [1, 2]], mesh.triangles[:, [0, 2]]])
    )
    middle = dict(zip(map(tuple, ends.tolist()), elements[:, 3:].T.ravel().tolist(), strict=True))
    try:
        middles = np.array([middle[min(a, b), max(a, b)] for a, b in mesh.facets.tolist()], dtype=np.int64)
    except KeyError as fault:
        raise InputError(place="mesh", found=f"the facet {fault} is the side of no triangle") from fault
    at, weight = np.polynomial.legendre.leggauss(_FACET_POINTS)
    s = 0.5 * (1.0 + at)
    shape = np.stack(
        [(1.0 - s) * (1.0 - 2.0 * s), s * (2.0 * s - 1.0), 4.0 * s * (1.0 - s)], axis=1
    )  # (q, 3)
    first, last = mesh.corners[mesh.facets[:, 0]], mesh.corners[mesh.facets[:, 1]]
    length = np.hypot(*(last - first).T)
    radius = first[:, :1] + np.outer(last[:, 0] - first[:, 0], s)
    area = math.pi * length[:, None] * radius * weight
    columns = np.repeat(np.column_stack([mesh.facets, middles]), len(s), axis=0)
    points = len(columns)
    values = sparse.csr_array(
        (np.tile(shape, (len(mesh.facets), 1)).ravel(), (np.repeat(np.arange(points), 3), columns.ravel())),
        shape=(points, size),
    )
    return values, area.ravel(), np.repeat(mesh.surface, len(s))


def _cooling(section: Section, which: IntArray) -> Cooling:
    """Return how points on the given surfaces cool."""
    surfaces = section.surfaces
    return Cooling(
        section.ambient,
        section.grid,
        section.films,
        law=np.array([each.law for each in surfaces], dtype=np.int64)[which],
        emissivity=np.array([each.emissivity for each in surfaces])[which],
        mount=np.array([each.mount for each in surfaces])[which],
        paths=np.array(
            [[PATHS.index(each.convection_path), PATHS.index(each.radiation_path)] for each in surfaces],
            dtype=np.int64,
        )
        .reshape(-1, 2)[which]
        .T,
    )
