"""Heat-transfer correlations: Nusselt numbers, radiation and fin efficiency, each with its range and source.

Every function is an equation on arrays of any shape. If the library ``ht`` has the same correlation, a test
compares both to 1e-12. ``ht`` itself accepts only scalars and is too slow here, because the tables of the
zone network need some hundred points per surface. ``surfaces`` selects the correlation for a surface.

An argument outside the stated range raises ``EnvelopeError``. There is one exception: temperature differences
near zero are accepted, because the heat flow by natural convection is then negligible.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mrdamper.arrays import FloatArray
from mrdamper.errors import EnvelopeError, InputError

STEFAN_BOLTZMANN = 5.670374419e-8
"""Stefan-Boltzmann constant [W/(m^2 K^4)]."""


# ------------------------------------------------------------------------------------- natural convection


def nusselt_horizontal_cylinder(rayleigh: ArrayLike, prandtl: ArrayLike) -> FloatArray:
    r"""Return the mean Nusselt number of an isothermal horizontal cylinder in still fluid.

    .. math:: Nu_D = \Bigl(0.60 + 0.387\,Ra_D^{1/6} / [1 + (0.559/Pr)^{9/16}]^{8/27}\Bigr)^2

    Parameters
    ----------
    rayleigh : Rayleigh number based on the diameter [-], up to 1e12 (below 1e-5, Nu approaches 0.36)
    prandtl : Prandtl number at film temperature [-], positive

    Raises
    ------
    EnvelopeError
        If an argument is outside the stated range.

    Notes
    -----
    Source: Churchill & Chu, Int. J. Heat Mass Transfer 18 (1975) 1049-1053; as in the library ``ht``.
    """
    number, pr = _check_range("Ra_D of a horizontal cylinder", rayleigh, 0.0, 1e12), _positive(prandtl)
    return np.asarray((0.60 + 0.387 * number ** (1 / 6) / (1 + (0.559 / pr) ** (9 / 16)) ** (8 / 27)) ** 2)


def nusselt_vertical_plate(rayleigh: ArrayLike, prandtl: ArrayLike) -> FloatArray:
    r"""Return the mean Nusselt number of an isothermal vertical plate, or a stout vertical cylinder.

    .. math:: Nu_L = \Bigl(0.825 + 0.387\,Ra_L^{1/6} / [1 + (0.492/Pr)^{9/16}]^{8/27}\Bigr)^2

    Parameters
    ----------
    rayleigh : Rayleigh number based on the height [-], up to 1e12
    prandtl : Prandtl number at film temperature [-], positive

    Notes
    -----
    Source: Churchill & Chu, Int. J. Heat Mass Transfer 18 (1975) 1323-1329; as in the library ``ht``. The
    equation is valid for a vertical cylinder if D / L >= 35 / Gr_L^(1/4).
    """
    number, pr = _check_range("Ra_L of a vertical plate", rayleigh, 0.0, 1e12), _positive(prandtl)
    return np.asarray((0.825 + 0.387 * number ** (1 / 6) / (1 + (0.492 / pr) ** (9 / 16)) ** (8 / 27)) ** 2)


def nusselt_slender_vertical_cylinder(
    grashof: ArrayLike, prandtl: ArrayLike, height_over_diameter: float
) -> FloatArray:
    r"""Return the mean Nusselt number, based on the height, of an isothermal slender vertical cylinder.

    .. math:: Nu_L = Nu_{plate}\,\{1 + B\,[\sqrt{32}\,Gr_L^{-1/4} L/D]^C\}

    with B = 0.0571322 + 0.20305 Pr^-0.43 and C = 0.9165 - 0.0043 Pr^0.5 + 0.01333 ln Pr + 0.0004809 / Pr.

    Parameters
    ----------
    grashof : Grashof number based on the height [-], positive (0 is replaced by 1; the heat flow is small)
    prandtl : Prandtl number at film temperature [-], 0.01 to 100
    height_over_diameter : L / D [-], positive

    Notes
    -----
    Source: Popiel, Wojtkowiak & Bober, Exp. Thermal Fluid Sci. 32 (2007) 607-613, with the plate of Churchill
    & Chu; as in the library ``ht``. The ten methods of ``ht`` for this case differ by a factor of four.
    """
    number = np.maximum(_check_range("Gr_L of a vertical cylinder", grashof, 0.0, 1e14), 1.0)
    pr = _check_range("Pr of the fluid", prandtl, 0.01, 100.0)
    _positive(height_over_diameter)
    factor = 0.0571322 + 0.20305 * pr**-0.43
    power = 0.9165 - 0.0043 * pr**0.5 + 0.01333 * np.log(pr) + 0.0004809 / pr
    bend = (32**0.5 * number**-0.25 * height_over_diameter) ** power
    return np.asarray(nusselt_vertical_plate(number * pr, pr) * (1 + factor * bend))


def nusselt_fin_disc(rayleigh: ArrayLike) -> FloatArray:
    """Return the mean Nusselt number of the two faces of a single horizontal disc, hot or cold.

    The Nusselt number is 0.54 Ra^(1/4) (0.15 Ra^(1/3) above 1e7) on one face and 0.27 Ra^(1/4) on the other
    face. The function is used for fins on a vertical damper. The characteristic length is the area of a face
    divided by its outer perimeter.

    Parameters
    ----------
    rayleigh : Rayleigh number based on this length [-], 1e5 to 1e10; smaller values are extrapolated

    Notes
    -----
    Source: McAdams, Heat Transmission; as in the library ``ht`` (``Nu_horizontal_plate_McAdams``).
    """
    number = _check_range("Ra of a horizontal disc", rayleigh, 0.0, 1e10)
    root = number**0.25
    upper = np.where(number <= 1e7, 0.54 * root, 0.15 * number ** (1 / 3))
    return np.asarray(0.5 * (upper + 0.27 * root))


# -------------------------------------------------------------------------------------- forced and mixed


def nusselt_cross_flow(reynolds: ArrayLike, prandtl: ArrayLike) -> FloatArray:
    r"""Return the mean Nusselt number, based on the diameter, of a cylinder in cross-flow.

    .. math:: Nu_D = 0.3 + \frac{0.62\,Re^{1/2}Pr^{1/3}}{[1 + (0.4/Pr)^{2/3}]^{1/4}}
              \Bigl[1 + (Re/282000)^{5/8}\Bigr]^{4/5}

    Parameters
    ----------
    reynolds : Reynolds number based on the diameter [-], Re Pr >= 0.2, up to 1e7
    prandtl : Prandtl number at film temperature [-], positive

    Notes
    -----
    Source: Churchill & Bernstein, J. Heat Transfer 99 (1977) 300-306; as in the library ``ht``.
    """
    number, pr = _check_range("Re_D of a cylinder", reynolds, 0.0, 1e7), _positive(prandtl)
    _check_range("Re Pr of a cylinder", number * pr, 0.2, np.inf)
    front = 0.62 * number**0.5 * pr ** (1 / 3) / (1 + (0.4 / pr) ** (2 / 3)) ** 0.25
    return np.asarray(0.3 + front * (1 + (number / 282000.0) ** 0.625) ** 0.8)


def mixed_nusselt(natural: ArrayLike, forced: ArrayLike) -> FloatArray:
    """Return the Nusselt number of mixed convection, for forced flow transverse to the natural flow.

    .. math:: Nu^3 = Nu_{natural}^3 + Nu_{forced}^3

    Notes
    -----
    Known as Churchill's blending, with the exponent 3 for transverse flow. The equation holds for
    heat-transfer coefficients and for Nusselt numbers based on the same length.
    """
    return np.cbrt(np.asarray(natural, dtype=np.float64) ** 3 + np.asarray(forced, dtype=np.float64) ** 3)


# ---------------------------------------------------------------------------------------------- radiation


def radiation_film(emissivity: ArrayLike, surface_K: ArrayLike, ambient_K: float) -> FloatArray:
    r"""Return the heat-transfer coefficient of radiation to large surroundings [W/(m^2 K)].

    .. math:: h_r = \varepsilon\,\sigma\,(T_w^2 + T_a^2)(T_w + T_a)

    The heat flux h_r (T_w - T_a) is then exactly the Stefan-Boltzmann law.
    """
    kelvin = np.asarray(surface_K, dtype=np.float64)
    share = np.asarray(emissivity, dtype=np.float64) * STEFAN_BOLTZMANN
    return np.asarray(share * (kelvin**2 + ambient_K**2) * (kelvin + ambient_K))


def groove_emissivity(emissivity: float, opening: float, walls: float) -> float:
    r"""Return the apparent emissivity of the opening of a grey, diffuse, isothermal groove [-].

    .. math:: \varepsilon_{app} = [1 + (A_{open}/A_{wall})(1/\varepsilon - 1)]^{-1}

    Parameters
    ----------
    emissivity : emissivity of the walls [-], 0 to 1; the result for 0 is 0
    opening, walls : area of the opening, and total area of all walls [m^2], opening <= walls

    Notes
    -----
    Source: grey cavity, in textbooks of radiation.
    """
    if not 0.0 <= emissivity <= 1.0:
        raise InputError(place="groove", found=f"emissivity is {emissivity}", expected="0 to 1")
    if not 0.0 < opening <= walls:
        raise InputError(
            place="groove",
            found=f"opening is {opening} m^2, its walls {walls} m^2",
            expected="the walls larger",
        )
    return 0.0 if emissivity == 0.0 else 1.0 / (1.0 + opening / walls * (1.0 / emissivity - 1.0))


# --------------------------------------------------------------------------------------------------- fins


def annular_fin_efficiency(
    film: ArrayLike, root_radius: float, tip_radius: float, thickness: float, conductivity: float
) -> FloatArray:
    r"""Return the efficiency of an annular fin of constant thickness with an insulated tip [-].

    .. math:: \eta = \frac{2 r_1}{m(r_2^2 - r_1^2)}
              \frac{K_1(mr_1)I_1(mr_2) - I_1(mr_1)K_1(mr_2)}{I_0(mr_1)K_1(mr_2) + K_0(mr_1)I_1(mr_2)},
              \qquad m = \sqrt{2h/(kt)}

    For a tip that loses heat, the caller passes the corrected radius r2 + t/2. The area of the two faces then
    includes the area of the tip, to first order in t / r2.

    Parameters
    ----------
    film : heat-transfer coefficient on the two faces [W/(m^2 K)], zero or more, any shape
    root_radius, tip_radius : radii r1 and r2 [m], 0 < r1 < r2
    thickness : thickness t of the fin [m]
    conductivity : conductivity of the fin [W/(m K)]

    Notes
    -----
    Source: exact solution, Kern & Kraus, Extended Surface Heat Transfer (1972); as in the library ``ht``.
    Exponentially scaled Bessel functions keep the result finite for any m.
    """
    from scipy.special import i0e, i1e, k0e, k1e

    if not (0.0 < root_radius < tip_radius and thickness > 0.0 and conductivity > 0.0):
        raise InputError(
            place="annular fin",
            found=(
                f"radii {root_radius} and {tip_radius} m, thickness {thickness} m, conductivity "
                f"{conductivity} W/(m K)"
            ),
            expected="root below tip, all positive",
        )
    h = _check_range("film coefficient of a fin", film, 0.0, np.inf)
    m = np.sqrt(2.0 * np.maximum(h, 1e-9) / (conductivity * thickness))
    inner, outer = m * root_radius, m * tip_radius
    # The scaled Bessel functions are I = Ie exp(x) and K = Ke exp(-x). The products therefore contain the
    # factors exp(+-(outer - inner)).
    shrink = np.exp(-2.0 * (outer - inner))
    above = k1e(inner) * i1e(outer) - i1e(inner) * k1e(outer) * shrink
    below = i0e(inner) * k1e(outer) * shrink + k0e(inner) * i1e(outer)
    return np.asarray(2.0 * root_radius / (m * (tip_radius**2 - root_radius**2)) * above / below)


# ------------------------------------------------------------------------------------------------- checks


def _check_range(what: str, value: ArrayLike, low: float, high: float) -> FloatArray:
    array = np.asarray(value, dtype=np.float64)
    outside = ~((array >= low) & (array <= high))
    if outside.any():
        raise EnvelopeError(
            f"{what} is {array[outside].flat[0]:g}",
            expected=f"{low:g} to {high:g}, where the correlation holds",
        )
    return array


def _positive(value: ArrayLike) -> FloatArray:
    array = np.asarray(value, dtype=np.float64)
    if not ((array > 0.0) & (array < np.inf)).all():
        raise EnvelopeError(
            found=f"{array[~(array > 0.0)].flat[:1]} is given", expected="positive, finite numbers"
        )
    return array
