"""Convection of annular fins on a horizontal tube: heat-transfer coefficients.

The *floor* is the tube between the fins, and the *rim* is the outer edge of a fin. In still air, the
correlation of Tsubouchi and Masuda yields the mean coefficient of fin sides and tube. A factor corrects this
correlation because the tube blocks the air in narrow gaps. In wind across the axis, the coefficients are
computed for a developing flow between two discs, which is driven by the wind pressure. docs/thermal.md
describes the validation. ``side_uncertainty`` and ``RIM_UNCERTAINTY`` quantify the errors. All functions
accept arrays of any shape and do not depend on geometry files.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from mrdamper.arrays import FloatArray
from mrdamper.errors import EnvelopeError

RIM_FORCED = 1.2
"""Coefficient of the fin rim divided by the coefficient of a cylinder with the outer fin diameter [-].

The ratio applies to air across the axis.
"""

RIM_UNCERTAINTY = 0.5
"""Relative half width of the 90 % interval of the rim coefficient, in still air and in wind [-]."""

_RATIOS = (1.05, 5.0)  # valid range of outer fin diameter divided by tube diameter
_OF_WIND = 1.6  # pressure that drives wind through a gap / (rho U^2 / 2); fitted to computed flows
_OF_CHANNEL = 0.91  # correction factor of the film coefficient in wind; fitted to computed flows
_RIM_THIN, _RIM_THICKNESS = 2.5, 1e-3  # rim coefficient / cylinder coefficient for a fin thickness [m]
STRIP_COUNT = 12  # number of strips into which a disc is divided
ITERATION_COUNT = 24
# These parameters of the floor coefficient (see ``floor_share``) were fitted to computed flows.
_FLOOR_WIDE, _FLOOR_GAP, _FLOOR_POWER = 1.2, 1.18, 5.0


def nusselt_annular_fins(rayleigh_gap: ArrayLike, diameter_ratio: float) -> FloatArray:
    r"""Return the mean Nusselt number, based on the gap, of annular fins and the horizontal tube.

    .. math:: Nu_S = \frac{\varphi Ra}{12\pi}\Bigl\{2 - e^{-b} - e^{-\beta b}\Bigr\},\qquad
              b = \frac{1}{\varphi}\Bigl(\frac{C}{Ra}\Bigr)^{3/4}

    with :math:`\varphi = x^2/(1 + x^2)`, :math:`\beta = 0.17/x + e^{-4.8/x}` and
    :math:`C = \{[23.7 - 1.1\sqrt{1 + 152/x^2}]/(1 + \beta)\}^{4/3}`.

    Parameters
    ----------
    rayleigh_gap : g beta dT S^3 / (nu a) times S / D [-], zero or more; S is the gap, D the outer diameter
    diameter_ratio : x = D / d of fins over tube [-], 1.05 to 5; most accurate for 1.67 to 3

    Raises
    ------
    EnvelopeError
        If an argument is outside these ranges.

    Notes
    -----
    For phi = 1 the equation is the correlation of Tsubouchi and Masuda (1970) for long fins, quoted by
    Raithby and Hollands (handbook chapter). We could not read either source. For Ra -> 0 the equation becomes
    Ra / (6 pi), which is developed flow between discs without a tube. A tube reduces this heat flow by the
    factor phi. The factor is computed for potential flow in the annulus with zero pressure at the rim and no
    flow through the tube wall. For thin layers (Ra -> infinity), phi has no effect.
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
    """Return the heat-transfer coefficient of a fin's rim divided by the coefficient of a cylinder.

    The cylinder has the outer diameter of the fin, and the air is still. The ratio is 2.5 for a fin with a
    thickness of 1 mm, as computed for one size of fin. The ratio approaches 1 for thick fins. The formula
    for other thicknesses is an assumption.

    Parameters
    ----------
    thickness : thickness of a fin [m]
    layer : thickness of the warm air layer: diameter of the cylinder divided by Nusselt number [m], any shape
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
    r"""Return the coefficient of the fin sides in wind, divided by the conductivity of air [1/m].

    The air flows across the axis. The space between two discs is divided into strips parallel to the flow.
    The strip at the height y is a channel of length c(y), which is the chord of the disc minus the tube. The
    air speed u in the strip follows from :math:`c_d U^2 = u^2[1 + 4 f c/(2S)]` with the apparent friction
    factor f of a developing laminar flow between plates. The Nusselt number is that for a thermally
    developing flow:

    .. math:: f Re = \frac{3.44}{\sqrt{x^+}} +
              \frac{24 + 0.674/(4x^+) - 3.44/\sqrt{x^+}}{1 + 2.9\,10^{-5}/x^{+2}},\qquad
              Nu = 7.55 + \frac{0.024\,x^{*-1.14}}{1 + 0.0358\,Pr^{0.17}x^{*-0.64}}

    with :math:`x^+ = c/(2S\,Re)`, :math:`Re = 2uS/\nu`, :math:`x^* = x^+/Pr`. The heat flow
    from each of the two fins to the air in a strip is :math:`\rho c_p u S/2\,(1 - e^{-4 Nu x^*})`.

    Parameters
    ----------
    speed : air speed U [m/s], positive
    gap, tube, outer : gap S, tube diameter d, outer diameter D [m]; d = 0, or D / d in the range of
        ``nusselt_annular_fins``
    viscosity, prandtl : properties of air at film temperature [m^2/s], [-], equal shape
    driving : ratio c_d of the pressure that drives the flow to the wind pressure; 1 for discs without a tube
    correction : factor on the result; 1 for discs without a tube (d = 0). For d > 0, the result also contains
        the factor phi of ``nusselt_annular_fins``, which is exact for narrow gaps.

    Raises
    ------
    EnvelopeError
        If the ratio of diameters is out of range.

    Notes
    -----
    Sources: apparent friction by Shah and London, Nusselt number by Stephan, as commonly quoted (we have read
    neither source). The default correction was fitted to computed flows for outer diameters of 46 and 92 mm
    at 2 m/s with gaps of 2 to 17 mm. It is valid for laminar flow at 0.5 to 10 m/s.
    """
    passed = _passed(_ratio(outer / tube)) if tube > 0.0 else 1.0
    height = 0.5 * outer * (np.arange(STRIP_COUNT) + 0.5) / STRIP_COUNT
    chord = np.sqrt(outer**2 - 4.0 * height**2) - np.sqrt(np.maximum(tube**2 - 4.0 * height**2, 0.0))
    nu = np.asarray(viscosity, dtype=np.float64)[..., None]
    pr = np.asarray(prandtl, dtype=np.float64)[..., None]
    drive = driving * speed**2
    log_speed = np.broadcast_to(0.5 * math.log(drive), np.broadcast_shapes(nu.shape, chord.shape)).copy()
    # Solve c_d U^2 = u^2 [1 + 4 f c / (2 S)] for the air speed u. Because f decreases with u, the
    # right side increases like u^p with p between 1 and 2. Each iteration assumes p = 1.5, and therefore
    # reduces the error of log u by more than half.
    for _ in range(ITERATION_COUNT):
        within = np.exp(log_speed)
        resistance = 1.0 + 2.0 * _friction(chord, gap, within, nu) * chord / gap
        log_speed -= np.log(within**2 * resistance / drive) / 1.5
    within = np.exp(log_speed)
    length = chord * nu / (4.0 * gap**2 * within) / pr
    nusselt = 7.55 + 0.024 * length**-1.14 / (1.0 + 0.0358 * pr**0.17 * length**-0.64)
    taken = 0.5 * within * gap * -np.expm1(-4.0 * nusselt * length) * pr / nu
    return np.asarray(passed * correction * taken.sum(axis=-1) / chord.sum())


def _friction(chord: FloatArray, gap: float, speed: FloatArray, viscosity: FloatArray) -> FloatArray:
    reynolds = 2.0 * speed * gap / viscosity
    entry = chord / (2.0 * gap * reynolds)
    start = 3.44 / np.sqrt(entry)
    return (start + (24.0 + 0.674 / (4.0 * entry) - start) / (1.0 + 2.9e-5 / entry**2)) / reynolds


def best_gap_in_wind(speed: float, length: float, viscosity: ArrayLike, prandtl: ArrayLike) -> FloatArray:
    """Return the gap of a stack of plates [m] for which the stack loses the most heat.

    The stack has a given size, and the number of plates follows from the gap. The gap is
    3.24 L Re_L^-1/2 Pr^-1/4 (Bejan and Sciubba), for laminar flow between plates of length L [m].
    """
    reynolds = speed * length / np.asarray(viscosity, dtype=np.float64)
    return np.asarray(3.24 * length / np.sqrt(reynolds) / np.asarray(prandtl, dtype=np.float64) ** 0.25)


def floor_share(
    speed: float, gap: float, outer: float, viscosity: ArrayLike, prandtl: ArrayLike
) -> FloatArray:
    """Return the coefficient on the tube between fins / coefficient on the fin sides [-].

    The ratio in wind is 1.2 (1 - exp(-(S / S0)^5)) for the gap S. S0 is 1.18 times ``best_gap_in_wind`` for
    the mean chord of a disc. The formula was fitted to computed flows for fins of one size at 2 m/s. At 1 and
    5 m/s, the error of the ratio is below 0.3.
    """
    wide = _FLOOR_GAP * best_gap_in_wind(speed, 0.25 * math.pi * outer, viscosity, prandtl)
    return np.asarray(-_FLOOR_WIDE * np.expm1(-((gap / wide) ** _FLOOR_POWER)))


def side_uncertainty(gap: float, diameter_ratio: float, speed: float) -> float:
    """Return the relative error [-] of the coefficients on fin sides and on the tube.

    The error is the half width of the 90 % interval, divided by the coefficient: 0.15 for gaps of 5 mm or
    more in still air, and 0.20 for smaller gaps and in wind. The error is 0.30 for fins shorter than a third
    of the tube diameter or longer than the tube diameter.
    """
    if not 1.67 <= diameter_ratio <= 3.0:
        return 0.30
    return 0.15 if speed == 0.0 and gap >= 5e-3 * (1.0 - 1e-9) else 0.20


def _passed(ratio: float) -> float:
    """Return the factor by which the tube reduces the air flow in a gap between fins."""
    return ratio**2 / (1.0 + ratio**2)


def _ratio(diameter_ratio: float) -> float:
    low, high = _RATIOS
    if not low <= diameter_ratio <= high:
        raise EnvelopeError(
            f"outer over inner diameter of annular fins is {diameter_ratio:g}",
            expected=f"{low:g} to {high:g}, where the law holds",
        )
    return float(diameter_ratio)
