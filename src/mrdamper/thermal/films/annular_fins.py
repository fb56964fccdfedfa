"""Convection of annular fins on a horizontal tube, as laws that know the gap: sides, floor and rim.

Still air by the law of Tsubouchi and Masuda, which averages the fins' sides and the tube between them, with
the tube in the way of the air where gaps are narrow; air across the axis as flow that develops between two
discs, driven by what the wind would do beside them. What these laws were held against, and how far they may
be off, is in docs/thermal.md; ``side_uncertainty`` and
``RIM_UNCERTAINTY`` say it in numbers. Arrays of any shape; nothing here knows of drawings.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from mrdamper.arrays import FloatArray
from mrdamper.errors import EnvelopeError

RIM_FORCED = 1.2
"""Film of the fins' rim in air across the axis, over a cylinder's of the fins' outer diameter [-]."""

RIM_UNCERTAINTY = 0.5
"""Of both [-]: half the width of an interval of 90 %, relative."""

_RATIOS = (1.05, 5.0)  # of outer diameter to tube's, for which the laws are offered
_OF_WIND = 1.6  # pressure that drives the air through a gap, over rho U^2 / 2; set on computed flows
_OF_CHANNEL = 0.91  # film over that of channels which the tube is in the way of; set on computed flows
_RIM_THIN, _RIM_THICKNESS = 2.5, 1e-3  # film of a thin fin's rim over a cylinder's, and how thin [m]
_STRIPS = 12  # of a disc, across the wind
_ROUNDS = 24
_FLOOR_WIDE, _FLOOR_GAP, _FLOOR_POWER = 1.2, 1.18, 5.0  # of the floor's film; set on computed flows


def nusselt_annular_fins(rayleigh_gap: ArrayLike, diameter_ratio: float) -> FloatArray:
    r"""Return the Nusselt number on the gap of annular fins on a horizontal tube: sides and floor together.

    .. math:: Nu_S = \frac{\varphi Ra}{12\pi}\Bigl\{2 - e^{-b} - e^{-\beta b}\Bigr\},\qquad
              b = \frac{1}{\varphi}\Bigl(\frac{C}{Ra}\Bigr)^{3/4}

    with :math:`\varphi = x^2/(1 + x^2)`, :math:`\beta = 0.17/x + e^{-4.8/x}` and
    :math:`C = \{[23.7 - 1.1\sqrt{1 + 152/x^2}]/(1 + \beta)\}^{4/3}`.

    Parameters
    ----------
    rayleigh_gap : g beta dT S^3 / (nu a) times S / D [-], zero or more; S is the gap, D the outer diameter
    diameter_ratio : x = D / d of fins over tube [-], 1.05 to 5; best known for 1.67 to 3

    Raises
    ------
    EnvelopeError
        Outside these ranges.

    Notes
    -----
    With phi = 1 it is known as the law of Tsubouchi and Masuda (1970) for long fins, as in the handbook
    chapter of Raithby and Hollands; neither could be re-read. That goes to Ra / (6 pi) for Ra -> 0, developed
    flow between discs without a tube. With one, it is potential flow in the ring, without pressure
    at the rim and without flow into the tube, and takes up phi of that heat. Where layers are thin
    (Ra -> infinity), phi changes nothing.
    """
    number = np.asarray(rayleigh_gap, dtype=np.float64)
    if not (np.isfinite(number) & (number >= 0.0)).all():
        raise EnvelopeError("Ra of a fin gap is negative or not finite", expected="zero or more")
    x = _ratio(diameter_ratio)
    beta = 0.17 / x + math.exp(-4.8 / x)
    turn = ((23.7 - 1.1 * math.sqrt(1.0 + 152.0 / x**2)) / (1.0 + beta)) ** (4 / 3)
    passed = _passed(x)
    bend = (turn / np.maximum(number, 1e-12)) ** 0.75 / passed
    return np.asarray(passed * number / (12.0 * math.pi) * (2.0 - np.exp(-bend) - np.exp(-beta * bend)))


def natural_rim_share(thickness: float, layer: ArrayLike) -> FloatArray:
    """Return the film of the fins' rim in still air, over a cylinder's of the fins' outer diameter [-].

    2.5 at 1 mm, as computed for one fin; for thick rims it goes to the cylinder's, over the thickness of that
    one's layer of warm air: the form between the two is an assumption.

    Parameters
    ----------
    thickness : of a fin [m]
    layer : of the cylinder, its diameter over its Nusselt number [m], any shape
    """
    warm = np.asarray(layer, dtype=np.float64)
    return np.asarray(1.0 + (_RIM_THIN - 1.0) * (_RIM_THICKNESS + warm) / (thickness + warm))


def forced_side_film(
    speed: float,
    gap: float,
    tube: float,
    outer: float,
    viscosity: ArrayLike,
    prandtl: ArrayLike,
    *,
    driving: float = _OF_WIND,
    correction: float = _OF_CHANNEL,
) -> FloatArray:
    r"""Return the film of the fins' sides over the air's conductivity [1/m] in air across the axis.

    Strips across the wind at the height y are channels of the length c(y), the disc's chord less the tube's.
    In each the air's speed u solves :math:`c_d U^2 = u^2[1 + 4 f c/(2S)]` with the apparent friction f of a
    laminar flow that develops between plates, and takes up heat by the Nusselt number of a thermally
    developing one:

    .. math:: f Re = \frac{3.44}{\sqrt{x^+}} +
              \frac{24 + 0.674/(4x^+) - 3.44/\sqrt{x^+}}{1 + 2.9\,10^{-5}/x^{+2}},\qquad
              Nu = 7.55 + \frac{0.024\,x^{*-1.14}}{1 + 0.0358\,Pr^{0.17}x^{*-0.64}}

    with :math:`x^+ = c/(2S\,Re)`, :math:`Re = 2uS/\nu`, :math:`x^* = x^+/Pr`. Each strip gives off what heats
    its air: :math:`\rho c_p u S/2\,(1 - e^{-4 Nu x^*})` to either side.

    Parameters
    ----------
    speed : of the air U [m/s], positive
    gap, tube, outer : S, and the diameters d and D [m]; x = D / d as in ``nusselt_annular_fins``, or d = 0
    viscosity, prandtl : of the air at film temperature [m^2/s], [-], one shape
    driving, correction : c_d and the factor on the film besides phi of ``nusselt_annular_fins``, by which a
        tube is in the way of narrow flow exactly, and of any here; 1, 1 and no tube are a disc alone

    Raises
    ------
    EnvelopeError
        A ratio of the diameters out of range.

    Notes
    -----
    Sources of the parts: Shah and London's apparent friction and Stephan's Nusselt number, as they are
    commonly quoted (neither was re-read). The default correction was set on flows computed for 46 and 92 mm
    at 2 m/s, gaps of 2 to 17 mm; for 0.5 to 10 m/s, laminar.
    """
    passed = _passed(_ratio(outer / tube)) if tube > 0.0 else 1.0
    height = 0.5 * outer * (np.arange(_STRIPS) + 0.5) / _STRIPS
    chord = np.sqrt(outer**2 - 4.0 * height**2) - np.sqrt(np.maximum(tube**2 - 4.0 * height**2, 0.0))
    nu = np.asarray(viscosity, dtype=np.float64)[..., None]
    pr = np.asarray(prandtl, dtype=np.float64)[..., None]
    drive = driving * speed**2
    log_speed = np.broadcast_to(0.5 * math.log(drive), np.broadcast_shapes(nu.shape, chord.shape)).copy()
    # the left side goes as u to the power of 1 to 2, so that each round leaves less than half of the error
    for _ in range(_ROUNDS):
        within = np.exp(log_speed)
        resistance = 1.0 + 2.0 * _friction(chord, gap, within, nu) * chord / gap
        log_speed -= np.log(within**2 * resistance / drive) / 1.5
    within = np.exp(log_speed)
    length = chord * nu / (4.0 * gap**2 * within) / pr
    nusselt = 7.55 + 0.024 * length**-1.14 / (1.0 + 0.0358 * pr**0.17 * length**-0.64)
    taken = 0.5 * within * gap * -np.expm1(-4.0 * nusselt * length) * pr / nu
    return np.asarray(passed * correction * taken.sum(axis=-1) / chord.sum())


def _friction(chord: FloatArray, gap: float, speed: FloatArray, viscosity: FloatArray) -> FloatArray:
    """Return the apparent friction factor of a flow that develops between plates [-]."""
    reynolds = 2.0 * speed * gap / viscosity
    entry = chord / (2.0 * gap * reynolds)
    start = 3.44 / np.sqrt(entry)
    return (start + (24.0 + 0.674 / (4.0 * entry) - start) / (1.0 + 2.9e-5 / entry**2)) / reynolds


def best_gap_in_wind(speed: float, length: float, viscosity: ArrayLike, prandtl: ArrayLike) -> FloatArray:
    """Return the gap of plates that gives off most in a given width [m]: 3.24 L Re_L^-1/2 Pr^-1/4.

    Known as the rule of Bejan and Sciubba for laminar flow between plates of the length L [m].
    """
    reynolds = speed * length / np.asarray(viscosity, dtype=np.float64)
    return np.asarray(3.24 * length / np.sqrt(reynolds) / np.asarray(prandtl, dtype=np.float64) ** 0.25)


def floor_share(
    speed: float, gap: float, outer: float, viscosity: ArrayLike, prandtl: ArrayLike
) -> FloatArray:
    """Return the film of the tube between the fins over that of their sides, in air across the axis [-].

    1.2 (1 - exp(-(S / S0)^5)), with S0 of 1.18 times ``best_gap_in_wind`` for a disc's mean chord: set on
    flows computed at one size and 2 m/s, and within 0.3 of those at 1 and 5 m/s.
    """
    wide = _FLOOR_GAP * best_gap_in_wind(speed, 0.25 * math.pi * outer, viscosity, prandtl)
    return np.asarray(-_FLOOR_WIDE * np.expm1(-((gap / wide) ** _FLOOR_POWER)))


def side_uncertainty(gap: float, diameter_ratio: float, speed: float) -> float:
    """Return how far the film of sides and floor may be off [-]: half an interval of 90 %, relative.

    0.15 for gaps from 5 mm on in still air, 0.20 below and in wind, 0.30 for fins shorter than a third of the
    tube's diameter or longer than the tube's diameter.
    """
    if not 1.67 <= diameter_ratio <= 3.0:
        return 0.30
    return 0.15 if speed == 0.0 and gap >= 5e-3 * (1.0 - 1e-9) else 0.20


def _passed(ratio: float) -> float:
    """Return what of a narrow flow between discs a tube in its way lets through [-]."""
    return ratio**2 / (1.0 + ratio**2)


def _ratio(diameter_ratio: float) -> float:
    low, high = _RATIOS
    if not low <= diameter_ratio <= high:
        raise EnvelopeError(
            f"outer over inner diameter of annular fins is {diameter_ratio:g}",
            expected=f"{low:g} to {high:g}, where the law holds",
        )
    return float(diameter_ratio)
