"""The heat equation after discretisation in space, and its integration in time.

    M dθ/dt = -K θ + p P(mean fluid) + W (c + E θ) - Bᵀ a q(B θ)        θ = T - ambient

with mass M, conduction K, loads p and c of mechanical and coil heat, rise of the coil resistance E, and heat
flux q at the points B of the surface, each with area a. The matrices are sparse for the finite elements,
small and dense for the reduced model. Both use the same integration (``stepping``). If the heat capacity of a
part depends on its mean temperature, so does M. The Jacobian is exact except for this dependence. The
contribution of the mean fluid temperature would fill the matrix. It is included by the Sherman-Morrison
formula.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse
from scipy.interpolate import CubicSpline
from scipy.linalg import lu_factor, lu_solve
from scipy.sparse.linalg import splu

from mrdamper.arrays import FloatArray
from mrdamper.errors import ConvergenceError, EnvelopeError, InputError
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.thermal.films.correlations import STEFAN_BOLTZMANN
from mrdamper.thermal.heat_capacity import CapacityCurve
from mrdamper.thermal.model.mesh import IntArray
from mrdamper.thermal.model.network import PATHS
from mrdamper.thermal.model.stepping import FIRST_STEP_S, EnergyAccount, Load, Part, Solver, integrate

Matrix = Any  # sparse matrix or array; both have @ and .T

_ROUNDING_K = 1e-5  # Newton steps below this size can be rounding errors.


class Cooling:
    """Cooling of surface points as a function of temperature: convection on a grid, radiation, mountings.

    Parameters
    ----------
    ambient : [K]
    grid, films : coefficients at grid temperatures, as in ``Section``
    law : row of ``films`` for each point, shape (p,)
    emissivity, mount : for each point, shape (p,)
    paths : columns of ``network.PATHS`` for convection and radiation of each point, shape (2, p)
    reference : temperature that corresponds to zero unknowns [K]; None: ambient
    """

    def __init__(
        self,
        ambient: float,
        grid: FloatArray,
        films: FloatArray,
        *,
        law: IntArray,
        emissivity: FloatArray,
        mount: FloatArray,
        paths: IntArray,
        reference: float | None = None,
    ) -> None:
        self.ambient, self.grid = ambient, grid
        self._reference = reference = ambient if reference is None else reference
        self._law, self._mount = law, mount
        self._black = emissivity * STEFAN_BOLTZMANN
        self._low, self._width = float(grid[0]) - reference, float(grid[1] - grid[0])
        # The heat flux itself is tabulated, as in the network: (knots, 4) per law.
        self._cubics = CubicSpline(grid, (films * (grid - ambient)).T).c.transpose(2, 1, 0).copy()
        points = np.arange(len(law))
        mount_column = np.full(len(law), PATHS.index("mount"))
        # The columns are convection, radiation and mount of all points.
        where = np.concatenate([paths[0], paths[1], mount_column])
        self._sort = sparse.csr_array(
            (np.ones(3 * len(law)), (where, np.concatenate([points + k * len(law) for k in range(3)]))),
            shape=(len(PATHS), 3 * len(law)),
        )

    def fluxes(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the fluxes by convection, radiation and mount [W/m^2], and their slopes, each (3, p)."""
        at = (theta - self._low) / self._width
        place = at.astype(np.intp)
        if theta.size and not (at.min() >= 0.0 and at.max() < self._cubics.shape[1]):
            raise self.refusal(theta)
        c3, c2, c1, c0 = self._cubics[self._law, place].T
        x = (at - place) * self._width
        kelvin = theta + self._reference
        cube = self._black * kelvin**3
        flux = np.stack(
            [
                ((c3 * x + c2) * x + c1) * x + c0,
                cube * kelvin - self._black * self.ambient**4,
                self._mount * (kelvin - self.ambient),
            ]
        )
        slope = np.stack([(3.0 * c3 * x + 2.0 * c2) * x + c1, 4.0 * cube, self._mount])
        return flux, slope

    def by_path(self, fluxes: FloatArray, area: FloatArray) -> FloatArray:
        """Return the heat of each path [W] from fluxes of shape (3, p)."""
        return np.asarray(self._sort @ (fluxes * area).ravel())

    def refusal(self, theta: FloatArray) -> EnvelopeError:
        """Return the error for temperatures outside the range of the losses."""
        worst = (
            theta[np.argmax(np.where(np.isfinite(theta), np.abs(theta), np.inf))]
            + self._reference
            - ZERO_CELSIUS_K
        )
        low, high = self.grid[0] - ZERO_CELSIUS_K, self.grid[-1] - ZERO_CELSIUS_K
        return EnvelopeError(
            place="heating",
            found=f"a surface is at {worst:.4g} degC",
            expected=f"{low:.0f} to {high:.0f} degC",
            remedy="Reduce the load, check the dimensions in the geometry file, or stop at the fluid limit",
        )


@dataclass(frozen=True, slots=True, eq=False)
class HotSpots:
    """Matrices from the unknowns to the temperatures at the candidate hot spots, shape (m, n) each."""

    gap: Matrix
    coil: Matrix
    seal: Matrix


@dataclass(frozen=True, slots=True, eq=False)
class StoredHeat:
    """A temperature-dependent heat capacity: the part's mass matrix at mean capacity, and its factor."""

    mass: Matrix  # [J/K], shape (n, n)
    curve: CapacityCurve


@dataclass(frozen=True, slots=True, eq=False)
class HeatEquation:
    """The matrices of the equation above with n unknowns, sparse or dense."""

    ambient: float  # [K]
    mass: Matrix  # [J/K], shape (n, n)
    stiffness: Matrix  # [W/K], shape (n, n)
    mechanical: FloatArray  # load of 1 W, shape (n,)
    electrical: FloatArray  # load of 1 W, shape (n,)
    warming: Matrix  # increase of a coil heat of 1 W at 20 degC with local temperature [1/K], shape (n, n)
    surface: Matrix  # values at the surface points, shape (p, n)
    area: FloatArray  # area of the points [m^2], shape (p,)
    cooling: Cooling
    fluid: FloatArray  # mean of the fluid, shape (n,)
    coil: FloatArray  # shape (n,)
    wall: FloatArray  # shape (n,)
    uniform: FloatArray  # unknowns for a uniform temperature of 1 K, shape (n,)
    reference_growth: float  # coil heat at ambient divided by that at 20 degC [-]
    spots: HotSpots
    storage: tuple[StoredHeat, ...] = ()

    @property
    def size(self) -> int:
        """Return the number of unknowns."""
        return len(self.uniform)

    def mass_at(self, state: FloatArray) -> Matrix:
        """Return the mass at the temperatures of a state [J/K], shape (n, n)."""
        found = self.mass
        for part in self.storage:
            row = part.mass @ self.uniform
            mean = float(row @ state) / float(row @ self.uniform) + self.ambient
            found = found + (part.curve.evaluate(mean) - 1.0) * part.mass
        return found

    def heat(self, states: FloatArray) -> FloatArray:
        """Return the heat of states relative to ambient [J], shape (...) for states (..., n)."""
        found = states @ (self.mass @ self.uniform)
        for part in self.storage:
            row = part.mass @ self.uniform
            above, capacity = states @ row, float(row @ self.uniform)
            start, end = (
                part.curve.integral(self.ambient + each / capacity) for each in (0.0 * above, above)
            )
            found = found + capacity * (end - start) - above
        return np.asarray(found)


@dataclass(frozen=True, slots=True, eq=False)
class FieldHeating(EnergyAccount):
    """Result of a simulation: temperatures, powers and energies at the ends of the steps.

    Columns of ``flow`` and ``energy`` are the paths of ``network.PATHS``, then mechanical power, coil heat.
    """

    equation: HeatEquation
    time: FloatArray  # [s], shape (k,)
    state: FloatArray  # unknowns above ambient [K], shape (k, n)
    flow: FloatArray  # [W], shape (k, 7)
    energy: FloatArray  # since the start [J], shape (k, 7)
    stopped: bool  # the fluid reached the temperature at which to stop

    def _mean(self, weights: FloatArray) -> FloatArray:
        return np.asarray(self.state @ weights + self.equation.ambient)

    @property
    def fluid(self) -> FloatArray:
        """Mean temperature of the fluid [K], shape (k,)."""
        return self._mean(self.equation.fluid)

    @property
    def coil(self) -> FloatArray:
        """Mean temperature of the coil [K], shape (k,)."""
        return self._mean(self.equation.coil)

    @property
    def wall(self) -> FloatArray:
        """Mean temperature of tube and caps [K], shape (k,)."""
        return self._mean(self.equation.wall)

    def hottest(self, part: Part) -> FloatArray:
        """Return the temperature of a part's hottest point [K], shape (k,)."""
        points: Matrix = getattr(self.equation.spots, part)
        return np.asarray((points @ self.state.T).max(axis=0) + self.equation.ambient)

    @property
    def columns(self) -> Mapping[str, Sequence[int]]:
        """Return the columns of the losses by path, without unused paths."""
        return {path: [k] for k, path in enumerate(PATHS) if self.flow[:, k].any() or self.energy[:, k].any()}

    @property
    def stored(self) -> FloatArray:
        """Heat stored since the start [J], shape (k,)."""
        found = self.equation.heat(self.state)
        return np.asarray(found - found[0])


def simulate_field(
    equation: HeatEquation,
    loads: Sequence[Load],
    *,
    start: float | FloatArray | None = None,
    longest_step: float = 60.0,
    first_step: float = FIRST_STEP_S,
    stop_at: float = math.inf,
) -> FieldHeating:
    """Simulate a heat equation with consecutive loads.

    Parameters
    ----------
    start : uniform temperature at the start [K], or unknowns above ambient, shape (n,); None: ambient
    longest_step : maximum step [s]; steps grow from ``first_step`` after each change of load
    stop_at : mean fluid temperature at which the simulation ends [K]

    Raises
    ------
    EnvelopeError
        If a surface leaves the temperature range of its losses.
    """
    return FieldHeating(
        equation,
        *integrate(
            FieldSystem(equation),
            loads,
            _first_state(equation, start),
            first_step=first_step,
            longest_step=longest_step,
            stop_at=stop_at,
        ),
    )


def steady_field(equation: HeatEquation, load: Load) -> FloatArray:
    """Return the steady unknowns above ambient for a load [K], shape (n,), by Newton's method.

    Raises
    ------
    ConvergenceError
        If there is no steady state (no losses), or the iteration did not converge.
    """
    system = FieldSystem(equation)
    system.take(load)
    state = _first_state(equation, equation.ambient + 50.0)
    before = math.inf
    for _ in range(60):
        here = system.evaluate(state)
        move = system.solver(here, 1.0, 0.0)(here.rate)
        # The change is measured in kelvin for any kind of unknowns.
        seen = (equation.surface @ move, equation.spots.gap @ move, equation.spots.coil @ move)
        largest = max(float(np.abs(each).max(initial=0.0)) for each in seen)
        if not math.isfinite(largest) or largest > 1e9:
            break
        state = np.asarray(state + move * min(1.0, 50.0 / max(largest, 1e-300)))
        # The iteration has converged, or only rounding errors remain.
        if largest < 1e-9 or before <= 2.0 * largest < 2.0 * _ROUNDING_K:
            return state
        before = largest
    raise ConvergenceError(
        place="steady state",
        found="Newton's method did not converge in 60 steps. Without losses there is no steady state",
    )


def _first_state(equation: HeatEquation, start: float | FloatArray | None) -> FloatArray:
    given = np.asarray(equation.ambient if start is None else start, dtype=np.float64)
    if given.ndim == 0:
        return np.asarray(equation.uniform * (float(given) - equation.ambient))
    if given.shape != (equation.size,):
        raise InputError(
            place="heating",
            found=f"start has shape {given.shape}",
            expected=f"one number or ({equation.size},)",
        )
    return given.copy()


@dataclass(frozen=True, slots=True, eq=False)
class _Here:
    """The terms of the equation at one state."""

    rate: FloatArray  # M dθ/dt [W], shape (n,)
    flow: FloatArray  # [W], shape (7,)
    slopes: FloatArray  # slopes of the surface fluxes [W/(m^2 K)], shape (3, p)
    power_slope: float  # slope of the mechanical power [W/K]


class FieldSystem:
    """A heat equation as a ``stepping.System``.

    A state contains the n unknowns above ambient [K], then the energies of the paths and of both sources [J].
    """

    def __init__(self, equation: HeatEquation) -> None:
        self.equation, self.nodes = equation, equation.size
        # 1ᵀ E: contribution of a state to the heat of a coil with 1 W.
        self._warm_row = np.asarray(equation.warming.T @ equation.uniform)
        self._mass = equation.mass  # at the point of linearisation

    def take(self, load: Load) -> None:
        """Set the load: its power becomes a spline on the temperature grid, as in the network."""
        grid = self.equation.cooling.grid
        self._power = CubicSpline(grid - self.equation.ambient, load.power(grid))
        self._coil_W = load.coil_W

    def fluid(self, state: FloatArray) -> float:
        """Return the mean fluid temperature [K]."""
        return float(self.equation.fluid @ state[: self.nodes]) + self.equation.ambient

    def rate(self, state: FloatArray) -> FloatArray:
        """Return M dθ/dt and the flows [W] in the shape of the state."""
        here = self.evaluate(state[: self.nodes])
        warming = here.rate
        if self.equation.storage:  # use the mass at the point of linearisation
            mass = self.equation.mass_at(state[: self.nodes])
            warming = self._mass @ factorise(mass)(warming)
        return np.concatenate([warming, here.flow])

    def inertia(self, rate: FloatArray) -> FloatArray:
        """Return M times the rate of the unknowns; energies are unchanged."""
        return np.concatenate([self._mass @ rate[: self.nodes], rate[self.nodes :]])

    def balance(self, before: FloatArray, after: FloatArray) -> FloatArray:
        """Return the state after a step, shifted uniformly to close the energy balance.

        If heat capacities depend on temperature, the balance of a step is only as accurate as its order.
        """
        e, n = self.equation, self.nodes
        if not e.storage:
            return after
        gone = after[n:] - before[n:]
        wanted = float(e.heat(before[:n])) + float(gone[-2:].sum() - gone[:-2].sum())
        found = after.copy()
        for _ in range(3):
            capacity = float(e.uniform @ (e.mass_at(found[:n]) @ e.uniform))
            found[:n] += (wanted - float(e.heat(found[:n]))) / capacity * e.uniform
        return found

    def linearise(self, state: FloatArray, shrunk: float) -> tuple[FloatArray, Solver]:
        """Return the rate at a state, and the solver of (M - shrunk J) x = b."""
        n = self.nodes
        here = self.evaluate(state[:n])
        self._mass = self.equation.mass_at(state[:n])
        solve = self.solver(here, shrunk, 1.0)

        def with_energies(right: FloatArray) -> FloatArray:
            move = solve(right[:n])
            return np.concatenate([move, right[n:] + shrunk * self.flow_change(here, move)])

        return np.concatenate([here.rate, here.flow]), with_energies

    def evaluate(self, state: FloatArray) -> _Here:
        """Return the terms of the equation at a state."""
        e = self.equation
        fluxes, slopes = e.cooling.fluxes(e.surface @ state)
        mean = float(e.fluid @ state)
        power, power_slope = float(self._power(mean)), float(self._power(mean, 1))
        coil = self._coil_W * (e.reference_growth + float(self._warm_row @ state))
        rate = power * e.mechanical + (self._coil_W * e.reference_growth) * e.electrical
        rate += self._coil_W * (e.warming @ state) - e.stiffness @ state
        rate -= e.surface.T @ (e.area * fluxes.sum(axis=0))
        flow = np.concatenate([e.cooling.by_path(fluxes, e.area), [power, coil]])
        return _Here(rate, flow, slopes, power_slope)

    def flow_change(self, here: _Here, move: FloatArray) -> FloatArray:
        """Return the first-order change of the flows for a change of the state [W]."""
        e = self.equation
        lost = e.cooling.by_path(here.slopes * (e.surface @ move), e.area)
        gained = [here.power_slope * (e.fluid @ move), self._coil_W * (self._warm_row @ move)]
        return np.concatenate([lost, gained])

    def solver(self, here: _Here, shrunk: float, inertia: float) -> Solver:
        """Return the solver of (inertia M - shrunk J) x = b, with J the derivative of the rate."""
        e = self.equation
        weight = e.area * here.slopes.sum(axis=0)
        bend = shrunk * here.power_slope
        matrix = inertia * self._mass + shrunk * (e.stiffness - self._coil_W * e.warming)
        matrix = matrix + shrunk * (e.surface.T @ (e.surface * weight[:, None]))
        solve = factorise(matrix)
        spread = solve(e.mechanical)
        gain = bend / (1.0 - bend * float(e.fluid @ spread))

        def corrected(right: FloatArray) -> FloatArray:
            plain = solve(right)
            return np.asarray(plain + spread * (gain * float(e.fluid @ plain)))

        return corrected


def factorise(matrix: Matrix) -> Solver:
    """Return a solver for a dense or sparse matrix."""
    if isinstance(matrix, np.ndarray):
        factors = lu_factor(matrix, check_finite=False)
        return lambda right: np.asarray(lu_solve(factors, right, check_finite=False))
    # The matrix is nearly symmetric, so pivots stay on the diagonal. Wide panels are not faster.
    sparse_factors = splu(
        sparse.csc_array(matrix),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.01,
        relax=1,
        panel_size=2,
        options={"SymmetricMode": True},
    )
    return lambda right: np.asarray(sparse_factors.solve(right))
