"""Lumped thermal model with one temperature: C dT/dt = P + i^2 R - G(T) (T - T_a), reference paper, Eq. (8).

The model is a network with one node and the surfaces of the zone network. The fin efficiency reduces the
losses of the fins. The model does not resolve the temperature of the coil, which is 8 to 17 K hotter than the
damper.
"""

from __future__ import annotations

import math

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.model.network import ThermalNetwork, zone_network
from mrdamper.thermal.model.surfaces import fin_efficiency


def lumped_network(drawing: DamperDrawing) -> ThermalNetwork:
    """Return a network with one node, which has the total heat capacity and all losses of a geometry."""
    zones = zone_network(drawing)
    watts: dict[str, FloatArray] = {}
    for path, row in zip(zones.loss_path, zones.watts, strict=True):
        watts[path] = watts.get(path, 0.0) + row
    if drawing.sink is not None:
        film, efficiency = fin_efficiency(drawing, zones.grid)
        sink, diameter = drawing.sink, drawing.body.outer_diameter
        # The contact resistance is in series with the fin. Therefore it reduces the efficiency.
        contact = sink.contact / (math.pi * diameter * sink.thickness)
        efficiency = efficiency / (1.0 + contact * film * sink.fin_area(diameter) * efficiency)
        for path in ("fin convection", "fin radiation"):
            if path in watts:
                watts[path] = watts[path] * efficiency
    one = np.ones(1)
    return ThermalNetwork(
        model="lumped",
        names=("damper",),
        capacity=np.array([zones.total_capacity]),
        conductance=np.zeros((1, 1)),
        mechanical=one,
        electrical=one,
        fluid=one,
        coil=one,
        wall=one,
        ambient=zones.ambient,
        grid=zones.grid,
        loss_node=(0,) * len(watts),
        loss_path=tuple(watts),
        watts=np.array(list(watts.values())).reshape(len(watts), len(zones.grid)),
    )
