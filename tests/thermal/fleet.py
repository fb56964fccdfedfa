"""Random dampers with a thermocouple, for the tests of prediction: what the predictor must not know.

Drawings, powers, surroundings and thermocouples are drawn evenly from the ranges below (``_RANGES``; the
capacity, the exchange and the stirring on a log scale) and run through the zone network. A damper that ends
less than 15 K above ambient or above 160 degC after 30 min is drawn anew.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.thermal.drawing import (
    Body,
    Calibration,
    Coil,
    DamperDrawing,
    Piston,
    Rod,
    Surroundings,
    find_filling,
)
from mrdamper.thermal.estimation.measured_curve import HeatingCurve, Place, lag_signal
from mrdamper.thermal.heatsink import HeatSink
from mrdamper.thermal.model.network import zone_network
from mrdamper.thermal.model.stepping import Load
from mrdamper.thermal.model.transient import simulate_network

DURATION_S = 1800.0


@dataclass(frozen=True)
class Member:
    """A damper of the fleet: what is measured, and the truth at 1 s steps."""

    curve: HeatingCurve
    ambient: float  # [K]
    fins: int
    time: FloatArray  # [s]
    truth: FloatArray  # [K] at the measured place, without noise and lag
    fluid: FloatArray  # [K]

    def truth_at(self, time_s: float) -> float:
        return float(np.interp(time_s, self.time, self.truth))


def draw_fleet(count: int, seed: int, *, place: Place = "fluid") -> list[Member]:
    """Return random dampers; the same seed gives the same ones."""
    rng = np.random.default_rng(seed)
    members: list[Member] = []
    while len(members) < count:
        member = _draw(rng, place)
        if member is not None:
            members.append(member)
    return members


def _draw(rng: np.random.Generator, place: Place) -> Member | None:
    u = rng.uniform
    drawing = _drawing(rng)
    network = zone_network(drawing)
    # power: P/C at 20 degC, a viscous share by Arrhenius, the yield share on a line
    watts = network.total_capacity * math.exp(u(math.log(0.02), math.log(0.15)))
    viscous, arrhenius, slope = u(0.05, 0.5), u(900.0, 1900.0), u(0.0, 0.002)
    coil = drawing.coil.resistance * u(0.0, 2.0) ** 2

    def power(kelvin: FloatArray) -> FloatArray:
        thin = np.exp(arrhenius * (1.0 / kelvin - 1.0 / 293.15))
        return np.asarray(watts * (viscous * thin + (1.0 - viscous) * (1.0 - slope * (kelvin - 293.15))))

    start = drawing.surroundings.ambient + (0.0 if u() < 0.5 else u(-2.0, 5.0))
    noise, lag, every = u(0.05, 0.5), u(1.0, 10.0), u(0.5, 5.0)
    try:
        heating = simulate_network(network, [Load(DURATION_S, power, coil)], start=start, longest_step=15.0)
    except InputError:
        return None
    end = float(heating.fluid[-1])
    if end < drawing.surroundings.ambient + 15.0 or end > 433.15:
        return None
    from scipy.interpolate import PchipInterpolator

    time = np.arange(0.0, DURATION_S + 0.5)
    seen = {"fluid": heating.fluid, "wall": heating.wall, "coil": heating.coil}[place]
    truth = PchipInterpolator(heating.time, seen)(time)
    samples = np.cumsum(rng.uniform(0.6, 1.4, round(DURATION_S / every * 1.1)) * every)
    samples = samples[samples <= DURATION_S]
    shown = np.interp(samples, time, lag_signal(time, truth, lag)) + noise * rng.standard_normal(len(samples))
    return Member(
        HeatingCurve(samples, shown, place),
        drawing.surroundings.ambient,
        drawing.sink.fins if drawing.sink else 0,
        time,
        truth,
        PchipInterpolator(heating.time, heating.fluid)(time),
    )


def _drawing(rng: np.random.Generator) -> DamperDrawing:
    u = rng.uniform
    outer, wall = u(0.035, 0.070), u(0.003, 0.006)
    piston = outer - 2.0 * wall - 2.0 * u(0.6e-3, 1.5e-3)
    rod = min(u(0.010, 0.020), 0.5 * piston)
    length, long = u(0.15, 0.35), u(0.04, 0.09)
    upright = u() < 0.3
    sink = None
    if u() < 0.5:
        thickness = u(0.001, 0.003)
        pitch = thickness + u(0.010 if upright else 0.004, 0.018)
        fins = int(rng.integers(1, 9))
        fins = min(fins, int((length - thickness) / pitch) + 1)
        sink = HeatSink(
            fins=fins, width=u(0.008, 0.035), thickness=thickness, pitch=pitch, emissivity=u(0.05, 0.95),
            film_multiplier=u(0.8, 1.8), correlation="disc" if upright else rng.choice(["channel", "vdi"]),
        )  # fmt: skip
    return DamperDrawing(
        body=Body(outer, length, wall, wall, orientation="vertical" if upright else "horizontal"),
        piston=Piston(piston, long),
        rod=Rod(rod, bool(u() < 0.5)),
        coil=Coil(u(2.0, 8.0), u(0.01, 0.035), 0.4 * 0.5 * (piston - rod)),
        filling=find_filling(
            "paper",
            {
                "stirring": math.exp(u(math.log(3.0), math.log(30.0))),
                "exchange": math.exp(u(math.log(5.0), math.log(60.0))),
            },
        ),
        surroundings=Surroundings(
            u(273.15, 313.15), 0.0 if u() < 0.5 else u(0.2, 4.0), u(0.1, 0.95), u(0.0, 0.3)
        ),
        sink=sink,
        calibration=Calibration(heat_capacity=u(0.8, 1.25), film=u(0.8, 1.25)),
    )  # fmt: skip
