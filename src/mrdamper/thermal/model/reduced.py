"""Thermal models with about twenty unknowns, made from finite-element models.

The heat equation is projected onto a rational Krylov space of temperature fields. One of these fields is
uniform, so that heat is conserved. The other fields are responses of the linearised heat equation: solutions
x of (K + H + s M) x = b for a few frequencies s. K is the conduction matrix, H the matrix of heat transfer at
the surface, and M the mass matrix. The load b is mechanical power, coil heat, or heat supplied to one kind of
surface. The nonlinear convection and radiation remain: they are evaluated at all points of the surface.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.thermal.model.finite_element import FieldModel
from mrdamper.thermal.model.heat_equation import (
    Cooling,
    HeatEquation,
    HotSpots,
    Matrix,
    StoredHeat,
    factorise,
)
from mrdamper.thermal.model.mesh import IntArray

REDUCED_ORDER = 22
"""Default number of unknowns."""

BASIS_RISE_K = 60.0  # temperature rise above ambient at which the heat transfer H is linearised
_SHIFTS = (0.0, 3e-3, 3e-2, 0.2, 2.0)  # frequencies of the responses to power and coil heat [1/s]
_SURFACE_SHIFTS = (0.0, 3e-3)  # frequencies of the responses to heat supplied to surfaces [1/s]
# Weights of the responses to mechanical power [W], coil heat [W], and heat at the surfaces [K].
_MECHANICAL_W, _COIL_W, _SURFACE_K = 100.0, 20.0, 20.0


@dataclass(frozen=True, slots=True, eq=False)
class ReducedModel:
    """A reduced-order heat equation with r unknowns, made from a finite-element model with n nodes.

    ``basis @ state`` is the temperature of the nodes above ambient [K].
    """

    full: FieldModel
    basis: FloatArray  # shape (n, r)
    equation: HeatEquation  # equation for the r unknowns

    @property
    def order(self) -> int:
        """Return the number of unknowns."""
        return self.equation.size

    def field(self, state: FloatArray) -> FloatArray:
        """Return the temperatures at the nodes of the full model [K] for given reduced unknowns."""
        return np.asarray(state @ self.basis.T + self.equation.ambient)


def reduce_field(
    model: FieldModel, *, order: int = REDUCED_ORDER, elsewhere: Sequence[Cooling] = ()
) -> ReducedModel:
    """Return the reduced-order model of a finite-element model.

    Parameters
    ----------
    order : maximum number of unknowns
    elsewhere : cooling in further surroundings for which the model must be valid; the lowest and the highest
        ambient temperature and air speed are sufficient
    """
    if order < 3:
        raise InputError(place="reduced model", found=f"order is {order}", expected="3 or more")
    equations = [model.equation, *(replace(model.equation, cooling=each) for each in elsewhere)]
    fields = np.hstack([_responses(each, model.surface) for each in equations])
    basis = _space(model.equation, fields, order)
    return ReducedModel(model, basis, project(model.equation, basis))


def project(equation: HeatEquation, basis: FloatArray) -> HeatEquation:
    """Return the Galerkin projection of a heat equation onto the columns of a basis."""
    heat, spots = equation.mass @ basis, equation.spots

    def small(matrix: Matrix) -> FloatArray:
        return np.asarray(basis.T @ (matrix @ basis))

    return replace(
        equation,
        mass=np.asarray(basis.T @ heat),
        stiffness=small(equation.stiffness),
        mechanical=basis.T @ equation.mechanical,
        electrical=basis.T @ equation.electrical,
        warming=small(equation.warming),
        surface=np.asarray(equation.surface @ basis),
        fluid=basis.T @ equation.fluid,
        coil=basis.T @ equation.coil,
        wall=basis.T @ equation.wall,
        uniform=heat.T @ equation.uniform,  # The basis is orthonormal with respect to the mass matrix.
        spots=HotSpots(
            *(np.asarray(points @ basis) for points in (spots.gap, spots.coil, spots.seal)),
        ),
        storage=tuple(StoredHeat(small(each.mass), each.curve) for each in equation.storage),
    )


def _responses(equation: HeatEquation, kinds: IntArray) -> FloatArray:
    """Return the temperature responses to heat of both sources and to heat supplied to each kind of surface.

    The shape is (nodes, responses).
    """
    weight = equation.cooling.fluxes(np.full(len(equation.area), BASIS_RISE_K))[1].sum(axis=0) * equation.area
    film = equation.surface.T @ (equation.surface * weight[:, None])
    surfaces = [equation.surface.T @ np.where(kinds == kind, weight, 0.0) for kind in np.unique(kinds)]
    found = []
    for shift in _SHIFTS:
        solve = factorise(equation.stiffness + film + shift * equation.mass)
        found += [solve(_MECHANICAL_W * equation.mechanical), solve(_COIL_W * equation.electrical)]
        if shift in _SURFACE_SHIFTS:
            found += [solve(_SURFACE_K * load) for load in surfaces]
    return np.array(found).T


def _space(equation: HeatEquation, fields: FloatArray, order: int) -> FloatArray:
    """Return a mass-orthonormal basis of the responses with at most ``order`` columns.

    The first column is a uniform temperature. The remaining columns are the dominant principal components.
    """
    basis = [equation.uniform / np.sqrt(equation.uniform @ (equation.mass @ equation.uniform))]
    for _ in range(2):  # The second orthogonalisation removes the rounding errors of the first.
        fields = fields - np.outer(basis[0], basis[0] @ (equation.mass @ fields))
    values, vectors = np.linalg.eigh(fields.T @ (equation.mass @ fields))
    keep = np.argsort(values)[::-1][: order - 1]
    keep = keep[values[keep] > 1e-14 * values.max()]
    return np.column_stack([basis[0], fields @ (vectors[:, keep] / np.sqrt(values[keep]))])
