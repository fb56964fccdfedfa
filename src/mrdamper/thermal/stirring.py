r"""Heat in the moving fluid: what gap and chambers conduct, and what the piston carries between them.

All three are laws of the stroke's amplitude A and frequency f, the piston's area A_p (less the rod's), the
gap's g and A_g, the piston's and a chamber's length L_p and L_c; k and rho c are the fluid's.

.. math::
    k_g / k &= Nu / 12, \quad Nu = 7.55 + \frac{0.024 x^{-1.14}}{1 + 0.0358 Pr^{0.17} x^{-0.64}},
        \quad x = \frac{L_p k}{4 g^2 \rho c\,u}, \quad u = 4 A f A_p / A_g \\
    k_c / k &= \max(1, h w / 4k), \quad h = 2 \sqrt{2 k \rho c f \varphi / \pi},
        \quad \varphi = \min(1, 2 A / L_c) \\
    G &= m\,\rho c\,f\,2 A A_p \min(1, 2 A A_p / (A_g L_p)), \quad m = 0.5

The first is a slit with heat made evenly in it, whose walls see a developing laminar flow (Stephan's Nusselt
number for parallel plates); the second a fluid that is renewed at the wall with every stroke (penetration
theory), w the chamber's width; the third the share m of the displaced volume that mixes before it comes
back, which is nothing while the stroke is too short to empty the gap. They are reasoned, not measured: m is
known within 0.25 to 1, the renewal's factor 2 within 1 to 4. Only for short strokes does that matter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

_PRANDTL = 300.0  # of MR fluids: 0.1 Pa s, 800 J/(kg K), 0.3 W/(m K); it hardly matters
_MIXED = 0.5


@dataclass(frozen=True, slots=True)
class Stroke:
    """How the piston moves on the average: a sine's amplitude and frequency; zero for rest."""

    amplitude: float  # [m]
    frequency: float  # [Hz]


PAPER_STROKE = Stroke(0.015, 1.0)
"""Of the usual duty; a drawing has it until a duty is known."""


@dataclass(frozen=True, slots=True)
class Channel:
    """What the laws know of a damper; lengths in metres."""

    gap: float
    gap_area: float  # [m^2]
    piston_area: float  # that displaces fluid [m^2]
    piston_length: float
    chamber_length: float
    chamber_width: float  # from rod to bore
    conductivity: float  # of the fluid at rest [W/(m K)]
    volumetric_heat: float  # of the fluid [J/(m^3 K)]


@dataclass(frozen=True, slots=True)
class FluidHeat:
    """Effective conductivities of gap and chambers [W/(m K)], and exchange of the gap with each [W/K]."""

    gap: float
    chamber: float
    exchange: float


def conduct_fluid(channel: Channel, stroke: Stroke) -> FluidHeat:
    """Return how the fluid of a channel conducts and carries heat under a stroke."""
    k, heat = channel.conductivity, channel.volumetric_heat
    swept = 2.0 * stroke.amplitude * channel.piston_area  # [m^3]
    speed = 2.0 * stroke.frequency * swept / channel.gap_area
    gap = k
    if speed > 0.0:
        x = channel.piston_length * k / (4.0 * channel.gap**2 * heat * speed)
        nusselt = 7.55 + 0.024 * x**-1.14 / (1.0 + 0.0358 * _PRANDTL**0.17 * x**-0.64)
        gap = k * nusselt / 12.0
    renewed = min(1.0, 2.0 * stroke.amplitude / channel.chamber_length)
    film = 2.0 * math.sqrt(2.0 * k * heat * stroke.frequency * renewed / math.pi)
    emptied = min(1.0, swept / (channel.gap_area * channel.piston_length))
    return FluidHeat(
        gap,
        max(k, 0.25 * film * channel.chamber_width),
        _MIXED * heat * stroke.frequency * swept * emptied,
    )
