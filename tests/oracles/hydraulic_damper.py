"""Reference for the hydraulic damper: its equations as rates, integrated by the BDF method of SciPy.

The C code of the rig and this module share only the parameters. All 22 states are integrated as in
``docs/hydraulic_rig.md``. Implicit equations (wall stress of a flow, pressure of a chamber with gas) are
solved by root finding.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from mrdamper.arrays import FloatArray
from mrdamper.errors import ConvergenceError
from mrdamper.excitation import CurrentSteps, Motion
from mrdamper.virtual_rig.hydraulic import HydraulicDamper

__all__ = ["Hydraulics", "reference_force"]

MU0 = 1.25663706212e-6
ATMOSPHERE = 101325.0
SEAL_SHARE = np.array([0.4, 0.3, 0.2, 0.1])
SEAL_PART = np.array([0.1, 0.2, 0.3, 0.4])
# Scale of each state. The states are command, coil current and integral part (3), flux (3), magnetic
# hysteresis (6), field, piston position, piston speed, oil content, valve flow, gas, and seal (4).
SCALE = np.array([1.0, 1.0, 1.0, *[1e-4] * 3, *[1.0] * 6, 1.0, 1e-2, 0.1, 1e-4, 1e-4, 1e-2, *[1e-2] * 4])


class Hydraulics:
    """The equations of a hydraulic damper at one temperature."""

    def __init__(self, damper: HydraulicDamper, degrees: float) -> None:
        p = self.p = damper
        self.T, self.dT = degrees + 273.15, degrees - 20.0
        self.A1 = math.pi / 4 * (p.bore_m**2 - p.rod_m**2)
        self.A2 = math.pi / 4 * (p.bore_m**2 - (p.rod_m**2 if p.through_rod else 0.0))
        self.V1, self.V2 = self.A1 * p.chamber_1_m, self.A2 * p.chamber_2_m
        self.gas_constant = p.gas_Pa * p.gas_m3 / 293.15
        cold = p.gas_m3 > 0.0
        charge = p.gas_Pa if cold else p.rest_Pa + p.rest_Pa_K * self.dT
        self._mix(0.0 if cold else self.dT)
        self.content = (self.V1 + self.V2) / self.phi(charge)
        self._mix(self.dT)
        self._fluid()

    def _mix(self, warmer: float) -> None:
        p, ex = self.p, 1.0 + self.p.expansion_per_K * warmer
        bulk = p.bulk_Pa * math.exp(-p.bulk_per_K * warmer)
        self.a = (1.0 - p.air) * ex / bulk
        self.c0 = (1.0 - p.air) * ex * (1.0 + ATMOSPHERE / bulk)
        self.b = p.air * ATMOSPHERE * (warmer + 293.15) / 293.15
        self.ex = ex

    def _fluid(self) -> None:
        p = self.p
        share = p.particle_share / self.ex
        nu = 10.0 ** (10.0 ** (p.walther_a - p.walther_b * math.log10(self.T))) - 0.7
        krieger = (1.0 - share / 0.64) ** -1.6
        self.eta = p.viscosity_scale * p.carrier_kg_m3 / self.ex * nu * 1e-6 * krieger

        def bloch(kelvin: float) -> float:
            return 1.0 - 3.4e-6 * float(kelvin**1.5)

        def chi(degrees: float) -> float:
            return 1.0 / (1.0 + math.exp((degrees - p.fade_degC) / p.fade_K))

        fallen = (bloch(self.T) / bloch(293.15)) ** 2 * chi(self.dT + 20.0) / chi(20.0)
        self.ts = p.yield_Pa * (share / p.particle_share) ** 1.52 * fallen
        self.width = math.pi * p.slot_diameter_m

    def phi(self, pressure: float) -> float:
        """Return the relative volume of the oil with gas at a pressure [-]."""
        return float(self.c0 - self.a * pressure + self.b / pressure)

    def pressures(self, place: float, content: float, gas: float) -> tuple[float, float]:
        """Return the pressures of the two chambers [Pa]."""
        p = self.p
        one = self._liquid((self.V1 - self.A1 * place) / content)
        filled, left = self.V2 + self.A2 * place + p.gas_m3, self.content - content
        if p.gas_m3 == 0.0:
            return one, self._liquid(filled / left)

        def excess(log_pressure: float) -> float:
            pressure = math.exp(log_pressure)
            return float(left * self.phi(pressure) + (gas / pressure) ** (1.0 / p.gas_exponent) - filled)

        return one, math.exp(brentq(excess, math.log(1e3), math.log(1e9), xtol=1e-15, rtol=1e-14))

    def _liquid(self, volume: float) -> float:
        rest = volume - self.c0
        root = math.sqrt(rest * rest + 4.0 * self.a * self.b)
        return 2.0 * self.b / (root + rest) if rest > 0.0 else (root - rest) / (2.0 * self.a)

    def fluid_field(self, density: float) -> float:
        """Return the field strength in the fluid [A/m], the odd solution of B = mu0 H + Js H / (H + Hsf)."""
        p, b = self.p, abs(density)
        z = MU0 * p.fluid_A_m + p.fluid_T - b
        root = math.sqrt(z * z + 4.0 * MU0 * b * p.fluid_A_m)
        h = 2.0 * b * p.fluid_A_m / (root + z) if z > 0.0 else (root - z) / (2.0 * MU0)
        return math.copysign(h, density)

    def flow(self, wall: float, yield_Pa: float) -> float:
        """Return the volume flow through the active length of the valve at a positive wall shear stress."""
        p, n = self.p, self.p.flow_index
        over = max(wall - yield_Pa, 0.0)
        m, k = n / (n + 1.0), n / (2.0 * n + 1.0)
        consistency = self.eta * p.flow_rate_1_s ** (1.0 - n)
        yielded = self.width * p.gap_m**2 / 2.0 * m * consistency ** (-1.0 / n)
        shape = over ** (1.0 + 1.0 / n) / wall * (1.0 - k * over / wall) if over > 0.0 else 0.0
        return float(yielded * shape + self.width * p.gap_m**2 * wall / (6.0 * p.creep * self.eta))

    def drop(self, flow: float, yield_Pa: float) -> float:
        """Return the pressure drop of the valve [Pa] at a volume flow."""
        p, speed = self.p, abs(flow)
        if speed == 0.0:
            return 0.0
        high = yield_Pa + 1.0
        while self.flow(high, yield_Pa) < speed:
            high *= 2.0
        wall = brentq(lambda t: self.flow(t, yield_Pa) - speed, 1e-300, high, xtol=1e-300, rtol=1e-14)
        thin = 1.0 + p.passive_s * 6.0 * speed / (self.width * p.gap_m**2)
        passive = 12.0 * p.passive_m * self.eta * (p.passive_least + p.passive_thinning / thin)
        lost = passive * speed / (self.width * p.gap_m**3)
        lost += p.entrance_loss * p.density_kg_m3 / 2.0 * speed**2 / (self.width * p.gap_m) ** 2
        return math.copysign(2.0 * p.active_m * wall / p.gap_m + lost, flow)

    def start(self, place: float, speed: float) -> FloatArray:
        """Return the initial states at zero current and equal pressures for a piston position and speed."""
        p, y = self.p, np.zeros(22)
        filled = self.V1 + self.V2 + p.gas_m3 + (self.A2 - self.A1) * place
        warmth = self.gas_constant * self.T

        def excess(log_pressure: float) -> float:
            pressure = math.exp(log_pressure)
            return self.content * self.phi(pressure) + warmth / pressure - filled

        pressure = math.exp(brentq(excess, math.log(1e3), math.log(1e9), xtol=1e-15, rtol=1e-14))
        y[13], y[14] = place, speed
        y[15] = (self.V1 - self.A1 * place) / self.phi(pressure)
        y[17] = pressure * (warmth / pressure) ** p.gas_exponent if warmth > 0.0 else 0.0
        y[18:] = place
        return y

    def magnet(self, command: float, y: FloatArray) -> FloatArray:
        """Return the rates of the first 13 states, from the command to the field."""
        p, rate = self.p, np.zeros(13)
        cf, i, integral = y[:3]
        error = cf - i
        asked = p.driver_V_A * error + p.coil_ohm * cf + integral
        volts = min(max(asked, p.supply_low_V), p.supply_V)
        rate[0] = (min(max(command, 0.0), p.highest_A) - cf) / p.command_lag_s
        rate[2] = p.driver_V_A_s * error + p.driver_release_1_s * (volts - asked)
        flux = np.append(y[3:6], 0.0)
        before = p.turns * i
        for k in range(3):
            own = flux[k] - flux[k + 1]
            b = 3.0 * own / p.core_m2
            h = b / (MU0 * p.permeability) * (1.0 + (abs(b) / p.knee_T) ** p.knee_exponent)
            stops = ((p.stop_1_T, p.stop_1_A_m), (p.stop_2_T, p.stop_2_A_m))
            for j, (width, height) in enumerate(stops):
                s = b - y[6 + 2 * k + j]
                h += height * s / width
                rate[6 + 2 * k + j] = math.copysign(max(abs(s) - width, 0.0) / p.stop_lag_s, s)
            force = p.core_m * h + 2.0 * p.gap_m * self.fluid_field(3.0 * own / p.pole_m2)
            shell = (p.shell_1_siemens, p.shell_2_siemens, p.shell_3_siemens)[k]
            rate[3 + k] = (before - force) / shell * (1.0 + p.steel_per_K * self.dT)
            before = force
        ohm = p.coil_ohm * (1.0 + p.copper_per_K * self.dT)
        rate[1] = (volts - ohm * i - p.turns * rate[3]) / p.leakage_henry
        rate[12] = (flux[0] / p.pole_m2 - y[12]) / p.fluid_lag_s
        return rate

    def joint(self, deflection: float, speed: float) -> float:
        """Return the force of the rod joint [N]."""
        p, e = self.p, deflection
        force = p.joint_N_m * e + p.joint_N_m3 * e**3 + p.joint_N_s_m * speed
        beyond = abs(e) - p.joint_gap_m
        if beyond > 0.0:
            side = math.copysign(1.0, e)
            force += side * p.pin_N * beyond**1.5 * max(0.0, 1.0 + p.pin_s_m * side * speed)
        return force

    def rates(self, x: float, v: float, command: float, y: FloatArray) -> FloatArray:
        """Return the rates of all states for a motion and a command."""
        p = self.p
        place, speed, content, flow, gas = y[13:18]
        one, two = self.pressures(place, content, gas)
        ratio = self.fluid_field(abs(y[12])) / p.yield_A_m
        yield_Pa = self.ts * (1.0 - math.exp(-(ratio**1.5))) + p.yield_least_Pa
        drop = one - two
        aside = p.bypass_m2 * math.sqrt(2.0 / p.density_kg_m3) * drop / (drop**2 + p.bypass_Pa**2) ** 0.25
        pressed = p.friction_share * one + (1.0 - p.friction_share) * two - ATMOSPHERE
        level = p.friction_N * math.exp(-p.friction_per_K * self.dT)
        level *= 1.0 + (p.friction_static - 1.0) / (1.0 + (speed / p.stribeck_m_s) ** 2)
        level *= 1.0 + p.friction_1_Pa * max(pressed, 0.0)
        rubs = SEAL_PART * p.friction_N_m * (place - y[18:])
        slip = np.sign(rubs) * np.maximum(np.abs(rubs) - SEAL_SHARE * level, 0.0)
        force = self.joint(x - place, v - speed)
        pushed = one * self.A1 - two * self.A2 + ATMOSPHERE * (self.A2 - self.A1)
        inertance = p.density_kg_m3 * (p.active_m + p.passive_m) / (self.width * p.gap_m)
        warming = 0.0
        if p.gas_m3 > 0.0:
            kelvin = two * (gas / two) ** (1.0 / p.gas_exponent) / self.gas_constant
            warming = -gas * (kelvin - self.T) / (p.gas_exchange_s * kelvin)
        mechanical = [
            speed,
            (force - pushed - float(rubs.sum())) / p.piston_kg,
            -(flow + aside),
            (drop - self.drop(flow, yield_Pa)) / inertance,
            warming,
        ]
        seal = slip / (p.friction_N_s_m * SEAL_SHARE)
        return np.concatenate([self.magnet(command, y), mechanical, seal])


def reference_force(
    damper: HydraulicDamper, motion: Motion, command: CurrentSteps, degrees: float, time: FloatArray
) -> FloatArray:
    """Return the force of the rod [N] at the times, which begin at zero, shape (n,).

    Raises
    ------
    ConvergenceError
        If the integrator fails.
    """
    equations = Hydraulics(damper, degrees)
    y = equations.start(float(motion.displacement(0.0)), float(motion.velocity(0.0)))
    ends = [*command.switches.tolist(), float(time[-1])]
    force = np.empty(len(time))
    begun = 0.0
    for level, end in zip(command.levels, ends, strict=True):
        inside = (time >= begun - 1e-12) & (time <= end + 1e-12)
        held: Callable[[float, FloatArray], FloatArray] = _held(equations, motion, level)
        found = solve_ivp(
            held, (begun, end), y / SCALE, method="BDF", t_eval=np.clip(time[inside], begun, end),
            rtol=1e-8, atol=1e-10,
        )  # fmt: skip
        if not found.success:
            raise ConvergenceError(f"BDF: {found.message}")
        states = found.y * SCALE[:, None]
        y = states[:, -1]
        x, v = motion.displacement(time[inside]), motion.velocity(time[inside])
        force[inside] = [equations.joint(x[k] - states[13, k], v[k] - states[14, k]) for k in range(len(x))]
        begun = end
    return force


def _held(equations: Hydraulics, motion: Motion, level: float) -> Callable[[float, FloatArray], FloatArray]:
    """Return the function of the scaled rates at a constant command."""

    def scaled(t: float, y: FloatArray) -> FloatArray:
        x, v = float(motion.displacement(t)), float(motion.velocity(t))
        rates: FloatArray = equations.rates(x, v, level, y * SCALE) / SCALE
        return rates

    return scaled
