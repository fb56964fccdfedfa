"""Reference for the kernel: an integrator for each hysteresis law, and a formula for Bouc-Wen.

Tests compare the kernel with this module. The equations have their textbook form. User-defined laws use the
same integrator (``mrdamper.models.python_law``). The formula for Bouc-Wen does not need the integrator: it
inverts the hypergeometric function along each monotonic piece of motion.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.optimize import brentq
from scipy.special import digamma, hyp2f1

from mrdamper.arrays import FloatArray
from mrdamper.errors import ConvergenceError
from mrdamper.excitation import Trajectory
from mrdamper.models.damper import Damper
from mrdamper.models.laws import HysteresisLaw
from mrdamper.models.python_law import Equations, hermite, integrate, turns_of

# The viscous force at this speed [m/s] is the coefficient ``viscosity`` times the speed.
_VISCOUS_SPEED = 0.1

Values = Mapping[str, float]
State = Sequence[float]
Equation = Callable[
    [float, float, float, Values], float
]  # The arguments are state, displacement, velocity and coefficients.


def simulate_reference(damper: Damper, trajectory: Trajectory, *, tolerance: float = 1e-10) -> FloatArray:
    """Return the force [N] of a damper at the samples, shape (n,), with this relative tolerance."""
    return integrate(damper, trajectory, _equations(damper.law), tolerance=tolerance)


def _common_terms(v: float, a: float, c: Values) -> float:
    """Return the force of viscosity, inertia and Stribeck friction, which are part of every law [N]."""
    stribeck = c["coulomb_friction"] + c["breakaway_friction"] * math.exp(
        -((v / c["stribeck_velocity"]) ** 2)
    )
    viscous = math.copysign(math.pow(abs(v) / _VISCOUS_SPEED, c["viscous_exponent"]), v) * _VISCOUS_SPEED
    return c["viscosity"] * viscous + c["mass"] * a + stribeck * math.tanh(v / c["transition_velocity"])


def _spring(x: float, c: Values) -> float:
    return c["stiffness"] * x + c["offset"]


def _bouc_wen_rate(w: float, v: float, rho: float, kappa: float, n: float) -> float:
    u = w if v > 0.0 else -w  # The variable u is positive if loading continues.
    if u >= 0.0:
        return rho * v * (1.0 - math.pow(u, n))
    # A rounding error beyond |u| = 1 would grow at kappa = 1.
    return rho * v * (1.0 - kappa * math.pow(min(-u, 1.0), n))


def _bouc_wen(w: float, _x: float, v: float, c: Values) -> float:
    return _bouc_wen_rate(w, v, c["rho"], c["kappa"], c["n"])


def _bouc_wen_force(w: float, x: float, _v: float, c: Values) -> float:
    return _spring(x, c) + c["yield_force"] * w


def _dahl(w: float, _x: float, v: float, c: Values) -> float:
    return _bouc_wen_rate(w, v, c["rho"], -1.0, 1.0)


def _saturating_force(w: float, x: float, v: float, c: Values) -> float:
    share = abs(v) / (abs(v) + c["saturation_velocity"])
    return _spring(x, c) + (c["yield_force"] + c["rate_force"] * share) * w


def _bingham_force(_w: float, x: float, v: float, c: Values) -> float:
    return _spring(x, c) + c["yield_force"] * math.tanh(v / c["yield_velocity"])


def _tanh_force(_w: float, x: float, v: float, c: Values) -> float:
    side = (x > 0.0) - (x < 0.0)
    return _spring(x, c) + c["yield_force"] * math.tanh(c["slope"] * v + c["shift"] * side)


def _compliance_force(e: float, e_rate: float, c: Values) -> float:
    """Return the force of free play, spring and leakage at travel e [m] and its rate [m/s]."""
    k, d, r = c["gap_stiffness"], c["gap"], c["gap_corner"]
    spring = k / 2 * (2 * e + math.hypot(e - d, r) - math.hypot(e + d, r))
    return spring + c["leak_damping"] * math.copysign(abs(e_rate) ** c["leak_exponent"], e_rate)


def _valve_force(y_rate: float, y: float, x: float, c: Values) -> float:
    """Return the force of the MR valve at its travel y [m] and velocity [m/s]."""
    thinning = c["thinning"] * math.copysign(abs(y_rate) ** c["thinning_exponent"], y_rate)
    shape = math.tanh(y_rate / c["yield_velocity"]) + thinning
    return c["offset"] + c["stiffness"] * y + c["yield_force"] * (1.0 + c["position_gain"] * x) * shape


def _valve_velocity(e: float, x: float, v: float, c: Values) -> float:
    """Return the velocity of the valve [m/s] at which valve force and compliance force are equal."""

    def surplus(y_rate: float) -> float:  # This function increases with y_rate.
        return _valve_force(y_rate, x - e, x, c) - _compliance_force(e, v - y_rate, c)

    at_rest = surplus(0.0)
    if at_rest == 0.0:
        return 0.0
    near, far = 0.0, math.copysign(c["yield_velocity"], -at_rest)
    while surplus(far) * at_rest > 0.0:
        near, far = far, 4.0 * far
        if abs(far) > 1e6:
            raise ConvergenceError(
                "series-valve: the valve cannot carry the compliance's force at any speed; "
                "give it thinning, or the compliance leak_damping"
            )
    return float(brentq(surplus, near, far, xtol=1e-30, rtol=1e-15, maxiter=500))


def _series_valve(e: float, x: float, v: float, c: Values) -> float:
    return v - _valve_velocity(e, x, v, c)


def _series_valve_force(e: float, x: float, v: float, c: Values) -> float:
    return _valve_force(_valve_velocity(e, x, v, c), x - e, x, c)


def _lugre_slip(w: float, v: float, c: Values) -> float:
    """Return the rate of the bristle deflection [m/s], which is the velocity minus the slip."""
    level = 1.0 + c["static_excess"] * math.exp(-((v / c["fade_velocity"]) ** 2))
    return v - abs(v) * w / level


def _lugre(w: float, _x: float, v: float, c: Values) -> float:
    return c["rho"] * _lugre_slip(w, v, c)


def _lugre_force(w: float, x: float, v: float, c: Values) -> float:
    return _spring(x, c) + c["yield_force"] * w + c["bristle_damping"] * _lugre_slip(w, v, c)


def _spencer_inner(state: State, v: float, c: Values) -> float:
    """Return the velocity y' of the series dashpot [m/s]. The state contains e = x - y [m] and w."""
    e, w = state
    pull = c["yield_force"] * w + c["inner_viscosity"] * v + c["inner_stiffness"] * e
    return pull / (c["inner_viscosity"] + c["series_damping"])


def _spencer(state: State, _x: float, v: float, c: Values) -> State:
    e_rate = v - _spencer_inner(state, v, c)
    return e_rate, _bouc_wen_rate(state[1], e_rate, c["rho"], c["kappa"], c["n"])


def _spencer_force(state: State, x: float, v: float, c: Values) -> float:
    return c["series_damping"] * _spencer_inner(state, v, c) + _spring(x, c)


def _double(state: State, _x: float, v: float, c: Values) -> State:
    first, second = state
    kappa, n = c["kappa"], c["n"]
    return _bouc_wen_rate(first, v, c["rho"], kappa, n), _bouc_wen_rate(second, v, c["second_rho"], kappa, n)


def _double_force(state: State, x: float, _v: float, c: Values) -> float:
    return _spring(x, c) + c["yield_force"] * state[0] + c["second_force"] * state[1]


def _chain_bristles(q: float, y: float, c: Values) -> list[tuple[float, float]]:
    """Return stiffness [N/m] and maximum force [N] of the five bristles at valve travel q and velocity y."""
    growth = 1.0 + c["position_gain"] * q + c["position_curvature"] * q**2
    whole = c["bristle_share"] * c["yield_force"] * growth * (1.0 + math.copysign(c["asymmetry"], y))
    k, apart = c["bristle_stiffness"], math.exp(c["bristle_spread"])
    excess = c["static_excess"] * math.exp(-((y / c["fade_velocity"]) ** 2))
    return [
        (k / 2, whole / 2),
        (k / 4 * apart, whole / 4),
        (k / 4 / apart, whole / 4),
        (c["friction_stiffness"], c["friction_force"] * (1.0 + excess)),
        (c["memory_stiffness"], c["memory_force"]),
    ]


def _chain_valve(y: float, q: float, c: Values) -> float:
    """Return the force of the chain's valve without its bristles [N]."""
    growth = 1.0 + c["position_gain"] * q + c["position_curvature"] * q**2
    side = 1.0 + math.copysign(c["flow_asymmetry"], y)
    linear, root = (
        c["yield_velocity"] + c["creep"] * c["yield_force"],
        c["bypass"] * math.sqrt(c["yield_force"] / side),
    )
    u = (math.sqrt((0.5 * root) ** 2 + linear * abs(y)) - 0.5 * root) ** 2 / linear**2
    u = math.copysign(u, y) if root else y / linear
    line = 0.5 * (math.hypot(u + 1.0, 0.05) - math.hypot(u - 1.0, 0.05))
    t = math.tanh(u) + c["knee"] * (line - math.tanh(u))
    viscoplastic = c["yield_force"] * (1.0 - c["bristle_share"]) * (1.0 + c["asymmetry"] * t) * t
    size = c["thinning"] * c["yield_force"] + c["thinning_force"]
    thinning = math.copysign(math.pow(abs(y) / c["reference_speed"], c["thinning_exponent"]), y) * size * side
    gas = c["gas_force"] * math.pow(1.0 + q / c["gas_length"], -1.3)
    return (
        c["offset"]
        + c["stiffness"] * q
        + gas
        + growth * (viscoplastic + thinning)
        + side * c["orifice"] * abs(y) * y
    )


def _rising_root(surplus: Callable[[float], float], scale: float) -> float:
    """Return the root of an increasing function. The search begins at zero with steps of ``scale``."""
    at_rest = surplus(0.0)
    if at_rest == 0.0:
        return 0.0
    far = math.copysign(scale, -at_rest)
    while surplus(far) * at_rest > 0.0:
        far *= 4.0
    return float(brentq(surplus, 0.0, far, xtol=1e-30, rtol=1e-15, maxiter=500))


def _chain_cavity(growth: float, c: Values) -> tuple[float, float]:
    """Return the length of the free gas in the cavity [m] and the resulting force of gas and charge [N].

    ``growth`` is the logarithm of the length divided by the length at rest.
    """
    length = c["bubble_length"] * math.exp(growth)
    room = 1.0 - (length - c["bubble_length"]) / c["cavity_length"]
    return length, c["cavity_force"] * (math.exp(-growth) - math.pow(max(room, 0.02), -1.3))


def _chain_moves(state: State, x: float, v: float, c: Values) -> tuple[float, float, float, float, float]:
    """Return velocities of valve, free play and spring [m/s], growth of the cavity [1/s], valve travel [m].

    The states are the travel inside the free play, the elastic travel, the growth of the cavity and the
    bristle forces.
    """
    lost, e, growth, *bristles = state
    half = c["play"]
    behind = v if half == 0.0 or (abs(lost) >= half and lost * v > 0.0) else 0.0
    unit = {**c, "leak_damping": c["leak_damping"] * math.pow(c["reference_speed"], 1.0 - c["leak_exponent"])}
    if c["cavity_length"] == 0.0:
        q = x - lost - e
        y = _rising_root(
            lambda y: _chain_valve(y, q, c) + sum(bristles) - _compliance_force(e, behind - y, unit),
            c["yield_velocity"],
        )
        return y, behind, behind - y, 0.0, q
    length, force = _chain_cavity(growth, c)
    q = x - lost - e + length - c["bubble_length"]
    y = _rising_root(lambda y: _chain_valve(y, q, c) + sum(bristles) - force, c["yield_velocity"])
    dashpot = (force - _compliance_force(e, 0.0, unit)) / unit["leak_damping"]
    slip = math.copysign(math.pow(abs(dashpot), 1.0 / c["leak_exponent"]), dashpot)
    return y, behind, slip, (y + slip - behind) / length, q


def _chain(state: State, x: float, v: float, c: Values) -> State:
    y, behind, slip, growth, q = _chain_moves(state, x, v, c)
    bends = zip(state[3:], _chain_bristles(q, y, c), strict=True)
    return (
        v - behind,
        slip,
        growth,
        *(k * (y - (abs(y) * f / level if level else y)) for f, (k, level) in bends),
    )


def _chain_force(state: State, x: float, v: float, c: Values) -> float:
    y, *_, q = _chain_moves(state, x, v, c)
    return _chain_valve(y, q, c) + sum(state[3:])


def _chain_scale(c: Values) -> State:
    force = max(c["yield_force"], 1.0)
    return 1e-3, force / c["gap_stiffness"], 1.0, *(force,) * 5


_EQUATIONS: Mapping[str, tuple[Equation | None, Equation]] = {
    "bouc-wen": (_bouc_wen, _bouc_wen_force),
    "dahl": (_dahl, _bouc_wen_force),
    "bouc-wen-saturating": (_bouc_wen, _saturating_force),
    "bingham": (None, _bingham_force),
    "tanh": (None, _tanh_force),
    "lugre": (_lugre, _lugre_force),
    "series-valve": (_series_valve, _series_valve_force),
}


def _equations(law: HysteresisLaw) -> Equations | None:
    """Return the equations of a law with the terms that all laws have, or None for a law in Python."""
    if law.python is not None:
        return None
    if law.name == "spencer":
        return Equations(_spencer, _with_common_terms(_spencer_force), lambda c: (1.0 / c["rho"], 1.0))
    if law.name == "chain":
        return Equations(_chain, _with_common_terms(_chain_force), _chain_scale)
    if law.name == "double-bouc-wen":
        return Equations(_double, _with_common_terms(_double_force), lambda _: (1.0, 1.0))
    rate, force = _EQUATIONS[law.name]
    summed = _with_common_terms(lambda state, x, v, c: force(state[0], x, v, c))
    if rate is None:
        return Equations(None, summed)
    one: Equation = rate
    scale = _travel_scale if law.name == "series-valve" else (lambda _: (1.0,))
    return Equations(lambda state, x, v, c: (one(state[0], x, v, c),), summed, scale)


def _with_common_terms(
    force: Callable[[State, float, float, Values], float],
) -> Callable[[State, float, float, float, Values], float]:
    return lambda state, x, v, a, c: force(state, x, v, c) + _common_terms(v, a, c)


def _travel_scale(c: Values) -> State:
    """Return the deflection of the compliance under the yield force [m]."""
    return (max(c["yield_force"], 1.0) / c["gap_stiffness"],)


# ------------------------------------------------------------------------------ closed form of Bouc-Wen


def turning_points(trajectory: Trajectory) -> tuple[tuple[int, float], ...]:
    """Return the reversals between samples as (interval, displacement [m]), from the cubic interpolant."""
    cubics = hermite(trajectory)
    return tuple(
        (k, float(np.polynomial.polynomial.polyval(theta, cubic)))
        for k, cubic in enumerate(cubics)
        for theta in turns_of(cubic.tolist())
    )


def bouc_wen_distance(w: float, kappa: float, n: float) -> float:
    r"""Return the normalised travel tau from w = 0 to w along one direction of motion [-].

    .. math:: \tau(w) = w\,F(1, 1/n; 1 + 1/n; w^n)

    F is Gauss's hypergeometric function, and dtau/dw = 1/(1 - w^n). If w < 0, kappa |w|^n replaces w^n.

    Notes
    -----
    SciPy's ``hyp2f1(a, b, c, z)`` loses all digits near z = 1 if c - a - b is a rounding error instead of 0.
    Therefore b is computed from c. From z = 1 - 1e-13 on, ``hyp2f1`` returns infinity. Therefore the leading
    terms of the logarithmic series replace it.
    """
    c = 1.0 + 1.0 / n
    b = c - 1.0
    argument = w**n if w >= 0.0 else kappa * (-w) ** n
    if argument > 1.0 - 1e-12:
        distance_to_one = -math.expm1(n * math.log(abs(w)))
        if w < 0.0:
            distance_to_one += (1.0 - kappa) * (-w) ** n
        if distance_to_one <= 0.0:
            return math.copysign(math.inf, w)
        return w * -b * (math.log(distance_to_one) + float(digamma(b)) + float(np.euler_gamma))
    return w * float(hyp2f1(1.0, b, c, argument))


def bouc_wen_state(distance: float, kappa: float, n: float) -> float:
    """Return w in [-1, 1] at the normalised travel tau [-], the inverse of ``bouc_wen_distance``."""
    low, high = math.nextafter(-1.0, 0.0), math.nextafter(1.0, 0.0)
    if distance >= bouc_wen_distance(high, kappa, n):
        return 1.0
    if distance <= bouc_wen_distance(low, kappa, n):
        return -1.0
    return float(
        brentq(lambda w: bouc_wen_distance(w, kappa, n) - distance, low, high, xtol=1e-16, rtol=1e-15)
    )


def bouc_wen_closed_form(
    displacement: Sequence[float] | FloatArray,
    turning: Sequence[tuple[int, float]] = (),
    *,
    rho: float,
    kappa: float,
    n: float,
) -> FloatArray:
    """Return the Bouc-Wen state w at the samples, exact to rounding, with w = 0 at the first sample.

    Parameters
    ----------
    displacement : at the samples [m], shape (n,)
    turning : reversals between samples, in order, as (k, displacement [m]) for interval k to k + 1
    rho, kappa, n : inverse yield displacement [1/m], unloading shape [-], sharpness [-]
    """
    between: dict[int, list[float]] = {}
    for k, x in turning:
        between.setdefault(k, []).append(x)
    here = origin = float(displacement[0])
    direction, start, w = 0.0, 0.0, 0.0
    states = [w]
    for k in range(len(displacement) - 1):
        for there in [*between.get(k, []), float(displacement[k + 1])]:
            towards = float(np.sign(there - here))
            if towards not in (0.0, direction):
                direction, origin = towards, here
                start = bouc_wen_distance(towards * w, kappa, n)
            if direction:
                w = direction * bouc_wen_state(start + rho * abs(there - origin), kappa, n)
            here = there
        states.append(w)
    return np.array(states)
