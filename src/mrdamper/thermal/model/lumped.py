"""The paper's Eq. (8): the whole damper at one temperature, C dT/dt = P + i^2 R - G(T) (T - T_a).

As a network of one node, its losses from the same surfaces as the zone network's (fins by their efficiency).
It is blind to the coil, which is 8 to 17 K hotter.
"""

from __future__ import annotations

import math

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.films.correlations import annular_fin_efficiency, radiation_film
from mrdamper.thermal.model.network import ThermalNetwork, zone_network
from mrdamper.thermal.model.surfaces import fin_film, fin_radiation


def lumped_network(drawing: DamperDrawing) -> ThermalNetwork:
    """Return the network of one node of a drawing: all capacities together, all losses at one temperature."""
    zones = zone_network(drawing)
    watts: dict[str, FloatArray] = {}
    for path, row in zip(zones.loss_path, zones.watts, strict=True):
        watts[path] = watts.get(path, 0.0) + row
    if drawing.sink is not None:
        efficiency = _fin_efficiency(drawing, zones.grid)
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


def _fin_efficiency(drawing: DamperDrawing, body_K: FloatArray) -> FloatArray:
    """Return the fins' efficiency with the body at the given temperatures [-], shape (g,).

    The film coefficients are taken at the body's temperature, as the losses are. A contact resistance and
    the fin are in series.
    """
    sink = drawing.sink
    if sink is None:
        raise ValueError("the drawing has no heat sink")  # a fault of ours: callers ask first
    diameter = drawing.body.outer_diameter
    emissivity, _ = fin_radiation(drawing)
    film = fin_film(drawing, body_K) + radiation_film(emissivity, body_K, drawing.surroundings.ambient)
    efficiency = annular_fin_efficiency(
        film, 0.5 * diameter, sink.corrected_radius(diameter), sink.thickness, sink.material.conductivity
    )
    contact = sink.contact / (math.pi * diameter * sink.thickness)
    return np.asarray(efficiency / (1.0 + contact * film * sink.fin_area(diameter) * efficiency))
