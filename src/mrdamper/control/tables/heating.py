"""What the look for a frozen thermometer needs to know of a damper: heat capacity, loss, coil.

A reading that stands still while the energy put in should have warmed the damper by more than ``frozen_K``
is not believed. One body, Eq. (8) of the paper: C dT/dt = F v + R i^2 - G (T - T_a). It accuses a sensor, it
does not predict a temperature: that is the business of ``thermal``.

Only warming accuses, and only with the loss taken ``loss_margin`` times and to the coldest surroundings there
may be (``ambient_K``, or the lowest temperature seen): a damper in balance with its surroundings reads one
value for hours. So a sensor that freezes near the balance, or while the damper cools, is not found out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from mrdamper.control.config import HeatBalance
from mrdamper.errors import InputError
from mrdamper.quantities import REFERENCE_K
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.model.lumped import lumped_network

_RISE_K = 60.0  # above ambient, where the loss of a drawing is taken


@dataclass(frozen=True, slots=True, kw_only=True)
class Heating:
    """Heat capacity and loss of a damper as one body; with a capacity of 0 nobody looks."""

    capacity_J_K: float
    loss_W_K: float
    ambient_K: float = REFERENCE_K
    resistance_20_ohm: float = 0.0  # of the coil; what it warms up by is left out
    amperes_per_volt: float | None = None  # where the command is a voltage; None: its coil's heat is left out
    source: str = "given"
    loss_margin: float = 1.5
    frozen_K: float = 5.0

    def __post_init__(self) -> None:
        for name in ("capacity_J_K", "loss_W_K", "ambient_K", "resistance_20_ohm", "loss_margin", "frozen_K"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise InputError(
                    place="heating", found=f"{name} is {value}", expected="a finite number, 0 or more"
                )
        if self.amperes_per_volt is not None and not math.isfinite(self.amperes_per_volt):
            raise InputError(
                place="heating",
                found=f"amperes_per_volt is {self.amperes_per_volt}",
                expected="a finite number",
            )

    @classmethod
    def of_drawing(cls, drawing: DamperDrawing) -> Heating:
        """Return those of a drawing: its whole capacity; its loss, fins and mount, 60 K above ambient."""
        network = lumped_network(drawing)
        loss = float(np.interp(network.ambient + _RISE_K, network.grid, network.watts.sum(axis=0)) / _RISE_K)
        return cls(
            capacity_J_K=network.total_capacity,
            loss_W_K=loss,
            ambient_K=network.ambient,
            resistance_20_ohm=drawing.coil.resistance,
            amperes_per_volt=drawing.coil.amperes_per_volt,
            source=f"drawing {drawing.name}",
        )

    @classmethod
    def paper(cls) -> Heating:
        """Return those of the paper's damper with its fins: taken where nothing else is known."""
        return _paper()

    def config(self, command_unit: str, *, extrapolate: bool) -> HeatBalance:
        """Return the kernel's part; a frozen temperature goes on by the energy put in, or is only flagged."""
        amperes = 1.0 if command_unit == "A" else self.amperes_per_volt or 0.0
        return HeatBalance(
            capacity=self.capacity_J_K,
            loss=self.loss_W_K,
            loss_margin=self.loss_margin,
            ambient=self.ambient_K,
            coil_heat=amperes**2 * self.resistance_20_ohm,
            frozen_rise=self.frozen_K,
            extrapolate=extrapolate,
        )


NO_HEATING = Heating(capacity_J_K=0.0, loss_W_K=0.0, source="none: a frozen thermometer is not looked for")


@cache
def _paper() -> Heating:
    return Heating.of_drawing(read_drawing("paper"))
