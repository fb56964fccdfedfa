r"""Heat transfer by the moving fluid: effective conductivities in gap and chambers, and transport by pumping.

The stroke has the amplitude A and the frequency f. The piston has the area A_p (without the rod) and the
length L_p. The gap has the width g and the area A_g, and a chamber has the length L_c. The fluid has the
conductivity k and the volumetric heat capacity rho c.

.. math::
    k_g / k &= Nu / 12, \quad Nu = 7.55 + \frac{0.024 x^{-1.14}}{1 + 0.0358 Pr^{0.17} x^{-0.64}},
        \quad x = \frac{L_p k}{4 g^2 \rho c\,u}, \quad u = 4 A f A_p / A_g \\
    k_c / k &= \max(1, h w / 4k), \quad h = 2 \sqrt{2 k \rho c f \varphi / \pi},
        \quad \varphi = \min(1, 2 A / L_c) \\
    G &= m\,\rho c\,f\,2 A A_p \min(1, 2 A A_p / (A_g L_p)), \quad m = 0.5

The first equation gives the conductivity k_g in the gap. It describes a slit with uniform heat generation and
developing laminar flow (Stephan's Nusselt number for parallel plates). The second equation gives the
conductivity k_c in a chamber of width w. It describes fluid at the wall that is renewed with every stroke
(penetration theory). The third equation gives the thermal conductance G between the gap and a chamber. The
fraction m of the displaced volume mixes before it returns. G approaches zero for strokes that are too short
to empty the gap. The equations are estimates that were not measured. Uncertain are m (0.25 to 1) and the
factor 2 in h (1 to 4). This uncertainty has an effect only for short strokes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from mrdamper.thermal.settings import SETTINGS

# Viscosity 0.1 Pa s, heat capacity 800 J/(kg K), conductivity 0.3 W/(m K). Results hardly depend on Pr.
MR_FLUID_PRANDTL = 300.0


@dataclass(frozen=True, slots=True)
class Stroke:
    """Mean motion of the piston: amplitude and frequency of a sine, zero at rest."""

    amplitude: float  # amplitude of the sine [m]
    frequency: float  # frequency of the sine [Hz]


PAPER_STROKE = Stroke(0.015, 1.0)
"""Stroke of the load cycle of the reference paper, which is the default of a geometry."""


@dataclass(frozen=True, slots=True)
class Channel:
    """Dimensions and fluid properties for the equations of this module; lengths in metres."""

    gap: float  # radial width of the gap
    gap_area: float  # cross-section of the gap [m^2]
    piston_area: float  # area of the piston that displaces fluid [m^2]
    piston_length: float
    chamber_length: float
    chamber_width: float  # radial distance from rod to bore
    conductivity: float  # conductivity of the fluid at rest [W/(m K)]
    volumetric_heat: float  # volumetric heat capacity of the fluid [J/(m^3 K)]


@dataclass(frozen=True, slots=True)
class FluidHeat:
    """Effective conductivities and conductance of the moving fluid."""

    gap: float  # effective conductivity in the gap [W/(m K)]
    chamber: float  # effective conductivity in the chambers [W/(m K)]
    exchange: float  # thermal conductance between the gap and each chamber [W/K]


def conduct_fluid(channel: Channel, stroke: Stroke) -> FluidHeat:
    """Return effective conductivities of the moving fluid, and the conductance between gap and chamber."""
    k, heat = channel.conductivity, channel.volumetric_heat
    swept = 2.0 * stroke.amplitude * channel.piston_area  # volume that a stroke displaces [m^3]
    speed = 2.0 * stroke.frequency * swept / channel.gap_area
    gap = k
    if speed > 0.0:
        x = channel.piston_length * k / (4.0 * channel.gap**2 * heat * speed)
        nusselt = 7.55 + 0.024 * x**-1.14 / (1.0 + 0.0358 * MR_FLUID_PRANDTL**0.17 * x**-0.64)
        gap = k * nusselt / 12.0
    renewed = min(1.0, 2.0 * stroke.amplitude / channel.chamber_length)
    film = 2.0 * math.sqrt(2.0 * k * heat * stroke.frequency * renewed / math.pi)
    emptied = min(1.0, swept / (channel.gap_area * channel.piston_length))
    return FluidHeat(
        gap,
        max(k, 0.25 * film * channel.chamber_width),
        SETTINGS.mixed_fraction * heat * stroke.frequency * swept * emptied,
    )
