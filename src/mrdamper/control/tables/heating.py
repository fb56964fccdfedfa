"""Heat balance of the damper, which detects a stuck thermometer (constant reading).

A constant reading is rejected if the energy supplied to the damper should have warmed it by more than
``frozen_K``. The model is one body, Eq. (8) of the reference paper: C dT/dt = F v + R i^2 - G (T - T_a). It
serves only to detect this fault. The package ``thermal`` predicts temperatures.

The reading of a damper in thermal equilibrium is constant for hours. To prevent false alarms, the expected
warming is computed with the largest possible heat loss: ``loss_ratio_max`` times the nominal conductance. For
the same reason, the surroundings are assumed to be as cold as possible (``ambient_K``, or the lowest
temperature so far). Therefore a sensor that sticks near thermal equilibrium or during cooling is not
detected.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from mrdamper.control.config import HeatBalance
from mrdamper.quantities import REFERENCE_K
from mrdamper.schema import NotNegative, check_ranges
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.model.lumped import lumped_network

_RISE_K = 60.0  # temperature above ambient at which the heat loss of a damper geometry is computed


@dataclass(frozen=True, slots=True, kw_only=True)
class Heating:
    """Heat capacity, heat loss and coil of a damper, modelled as one body.

    A capacity of 0 disables the detection of a stuck thermometer.
    """

    capacity_J_K: NotNegative
    loss_W_K: NotNegative
    ambient_K: NotNegative = REFERENCE_K
    resistance_20_ohm: NotNegative = 0.0  # coil resistance; its change with temperature is ignored
    amperes_per_volt: float | None = None  # for a command in volts; None: the coil heat is ignored
    source: str = "given"
    loss_ratio_max: NotNegative = 1.5
    frozen_K: NotNegative = 5.0

    def __post_init__(self) -> None:
        check_ranges(self, "heating")

    @classmethod
    def from_drawing(cls, drawing: DamperDrawing) -> Heating:
        """Return the heat balance of a damper geometry.

        The capacity is the sum of all parts. The loss is computed 60 K above ambient, with fins and mount.
        """
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
        """Return the default heat balance: the damper of the reference paper with its fins."""
        return _paper()

    def config(self, command_unit: str, *, extrapolate: bool) -> HeatBalance:
        """Return the heat balance in the form that the kernel uses.

        The kernel sets a flag if the temperature reading is stuck. If ``extrapolate`` is True, the kernel
        also estimates the temperature from the supplied energy.
        """
        amperes = 1.0 if command_unit == "A" else self.amperes_per_volt or 0.0
        return HeatBalance(
            heat_capacity=self.capacity_J_K,
            loss_conductance=self.loss_W_K,
            loss_ratio_max=self.loss_ratio_max,
            ambient=self.ambient_K,
            coil_heat=amperes**2 * self.resistance_20_ohm,
            frozen_rise_max=self.frozen_K,
            extrapolate=extrapolate,
        )


NO_HEATING = Heating(capacity_J_K=0.0, loss_W_K=0.0, source="none: a frozen thermometer is not detected")


@cache
def _paper() -> Heating:
    return Heating.from_drawing(read_drawing("paper"))
