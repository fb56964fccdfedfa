"""The paper's controller as one would write it in NumPy: a bank of models at constant currents, interpolated.

Every model keeps its own hysteresis; the current is read between the two models whose forces lie on either
side of the wanted one, at the present instant. Coefficients over temperature and the universal curve come
from tables that are made once. Readings are taken as good: none of the checks that ours makes on them.
"""

from __future__ import annotations

import numpy as np

from mrdamper import core
from mrdamper.arrays import FloatArray
from mrdamper.control.controllers import ForceController
from mrdamper.models.damper import Damper

__all__ = ["PlainBank"]

_LAW = "double-bouc-wen"


class PlainBank:
    """The bank of a damper of two Bouc-Wen elements; it remembers from step to step."""

    def __init__(self, damper: Damper, controller: ForceController) -> None:
        assert damper.law.name == _LAW
        config = controller.config
        self.currents = np.linspace(0.0, controller.largest, config.inverse.models)
        self.gains = [config.motion.gain_x, config.motion.gain_v, config.motion.gain_a]
        self.period, self.keep = controller.period_s, config.thermometer.keep
        self.kelvin = np.arange(config.axes.coldest, config.axes.warmest + 1.0)
        names = damper.law.names
        every = np.array([damper.coefficients_at(self.currents, float(k)) for k in self.kelvin])
        self.table = {name: every[:, i] for i, name in enumerate(names)}  # of temperature and model
        one = dict(zip(names, damper.coefficients_at(0.0, 293.15)[:, 0].tolist(), strict=True))
        self.travels = np.sinh(np.linspace(-4.5, 4.5, 20_001))
        self.curve = np.maximum.accumulate(core.curve(one["kappa"], one["n"], self.travels)[0])
        self.started = False
        self.x = self.v = self.a = self.temperature = 0.0
        self.w = np.zeros((2, len(self.currents)))

    def step(self, wanted: float, displacement: float, kelvin: float) -> float:
        """Return the command [A] for a wanted force [N] at a displacement [m] and a temperature [K]."""
        before, h = self.v, self.period
        self._follow(displacement, kelvin)
        place = (self.temperature - self.kelvin[0]) / (self.kelvin[1] - self.kelvin[0])
        low = min(max(int(place), 0), len(self.kelvin) - 2)
        share = min(max(place - low, 0.0), 1.0)
        c = {name: (1.0 - share) * rows[low] + share * rows[low + 1] for name, rows in self.table.items()}
        rho = np.stack([c["rho"], c["second_rho"]])
        if before * self.v < 0.0:  # the motion turns within the period
            part = before / (before - self.v)
            self._along(rho * 0.5 * h * before * part)
            self._along(rho * 0.5 * h * self.v * (1.0 - part))
        else:
            self._along(rho * 0.5 * h * (before + self.v))
        return self._between(self._force(c) - wanted)

    def _follow(self, displacement: float, kelvin: float) -> None:
        h = self.period
        if not self.started:
            self.started, self.x, self.temperature = True, displacement, kelvin
            return
        self.x += h * (self.v + 0.5 * h * self.a)
        self.v += h * self.a
        gap = displacement - self.x
        self.x += self.gains[0] * gap
        self.v += self.gains[1] * gap
        self.a += self.gains[2] * gap
        self.temperature += (1.0 - self.keep) * (kelvin - self.temperature)

    def _along(self, travel: FloatArray) -> None:
        """Carry every element of every model along the universal curve."""
        side = np.where(travel < 0.0, -1.0, 1.0)
        start = np.interp(side * self.w, self.curve, self.travels)
        self.w = side * np.interp(start + np.abs(travel), self.travels, self.curve)

    def _force(self, c: dict[str, FloatArray]) -> FloatArray:
        v = self.v
        bent = (max(abs(v), 1e-300) / 0.1) ** (c["viscous_exponent"] - 1.0)
        fade = np.exp(-((v / c["stribeck_velocity"]) ** 2))
        friction = (c["coulomb_friction"] + c["breakaway_friction"] * fade) * np.tanh(
            v / c["transition_velocity"]
        )
        yields = c["yield_force"] * self.w[0] + c["second_force"] * self.w[1]
        return np.asarray(
            c["viscosity"] * v * bent + c["stiffness"] * self.x + c["offset"] + friction + yields
        )

    def _between(self, off: FloatArray) -> float:
        """Return the lowest current at which the models' forces, joined by lines, are the wanted one."""
        crossed = np.flatnonzero(np.signbit(off[:-1]) != np.signbit(off[1:]))
        if not crossed.size:
            return float(self.currents[np.argmin(np.abs(off))])
        k = int(crossed[0])
        share = off[k] / (off[k] - off[k + 1])
        return float(self.currents[k] + share * (self.currents[k + 1] - self.currents[k]))
