"""Parameters of the lumped virtual damper: meaning, ranges and presets.

The module ``plant`` contains the equations. The parameters were not measured. They differ from the
coefficients of the identified laws, so that a law fitted to a preset has a realistic model error.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Annotated, ClassVar

import numpy as np

from mrdamper.errors import InputError
from mrdamper.quantities import REFERENCE_K, ZERO_CELSIUS_K
from mrdamper.schema import NotNegative, Option, Positive, check_ranges, fields_of

_SAFE = re.compile(r"[A-Za-z0-9][A-Za-z0-9.-]*")  # pattern of a name that is valid in a file name
_OF_THE_KIND = ("name", "full_current_A", "copper_per_K")  # parameters that random variants do not change


def check_parameters(damper: object, name: str) -> None:
    """Raise InputError if the name is not valid in a file name or a parameter is outside its range."""
    if not _SAFE.fullmatch(name):
        raise InputError(
            f"name is {name!r}",
            place="virtual damper",
            expected="letters, digits, dots and dashes, as it begins the runs' file names",
        )
    check_ranges(damper, f"virtual damper {name!r}")


@dataclass(frozen=True, slots=True)
class LumpedDamper:
    """Parameters of the lumped damper in SI units and kelvin; the defaults are the preset ``nominal``.

    Forces and lags apply at 20 degC. In the comments, T is the temperature, and m is the effective current
    after all lags. The dependence of the force on m is
    g = (tanh(m / field_current) / tanh(full_current / field_current))^field_exponent.

    Raises
    ------
    InputError
        If a parameter is not finite or outside its range, or the name is not valid in a file name.
    """

    kind: ClassVar[str] = "lumped"  # kind of the damper in the C extension

    name: str = "nominal"  # prefix of the run names
    # Parameters of driver and coil
    coil_ohm: Positive = 5.0  # R0: resistance of the coil at 20 degC
    copper_per_K: NotNegative = 0.00393  # coefficient a of the resistance R0 (1 + a (T - 20 degC))
    coil_henry: Positive = 0.04  # L0: inductance at zero current
    inductance_fall: NotNegative = 0.25  # coefficient b [1/A^2] of the inductance L0 / (1 + b i^2)
    supply_V: Positive = 24.0  # Vmax: voltage limit of the driver
    driver_V_A: NotNegative = 20.0  # Kp: proportional gain of the current controller
    driver_V_A_s: NotNegative = 2000.0  # Ki: integral gain of the current controller
    # Parameters of the magnetic field
    eddy_rise_s: Positive = 0.0045  # lag of the flux behind a rising current
    eddy_fall_s: Positive = 0.006  # lag of the flux behind a falling current
    eddy_per_K: NotNegative = 0.002  # coefficient c: the two eddy lags are divided by 1 + c (T - 20 degC)
    fluid_lag_s: Positive = 0.0015  # lag of the fluid structure behind the flux
    play_share: Annotated[float, Option(least=0.0, most=1.0)] = (
        0.4  # wp: fraction of the field with magnetic hysteresis (play operator)
    )
    play_A: NotNegative = 0.04  # r: half width of the play operator
    full_current_A: Positive = 2.0  # current at which the field function g is 1
    field_current_A: Positive = 1.5  # Is: saturation current
    field_exponent: Positive = 1.2  # p: exponent of the field function g
    # Parameters of yield force and pre-yield stiffness
    yield_N: Positive = 12.0  # Fy0: yield force without field
    yield_field_N: NotNegative = 1300.0  # Fym: additional yield force at full field (g = 1)
    yield_loss_per_K: NotNegative = 0.0014  # kT: relative decrease of Fym and s1 per kelvin
    low_field_loss: NotNegative = 0.3  # kx: below full field, kT is multiplied by 1 + kx (1 - g)
    stiffness_N_m: Positive = 1.2e6  # s0: stiffness without field
    stiffness_field_N_m: NotNegative = 5e6  # s1: additional stiffness at full field (g = 1)
    spread: Annotated[float, Option(least=0.0, most=0.5)] = (
        0.15  # weight of the soft bristle (stiffness times 1/4), and also of the stiff bristle (times 4)
    )
    asymmetry: Annotated[float, Option(least=-0.9, most=0.9)] = (
        0.015  # relative increase of the yield force in extension, equal to the decrease in compression
    )
    position: NotNegative = 0.0  # relative increase of the yield force at x = 5 mm; it grows with x^2
    # Parameters of the viscous force
    viscous_N: NotNegative = 250.0  # Fv0: viscous force at the reference speed
    viscous_m_s: Positive = 0.0314  # reference speed of the viscous force
    viscous_exponent: Positive = 0.88  # nv: exponent of the speed in the viscous force
    viscous_field: NotNegative = 0.15  # kvb: the field increases the viscous force by the factor 1 + kvb g
    # B and T0 of the viscosity, which is proportional to exp(B / (T - T0)); T0 = 0 is Arrhenius' equation
    viscosity_K: NotNegative = 404.0
    viscosity_pole_K: Annotated[float, Option(least=0.0, most=200.0)] = 153.15
    # Parameters of the friction
    friction_N: NotNegative = 40.0  # Fc: sliding friction force
    friction_static: NotNegative = 1.5  # static divided by sliding friction
    stribeck_m_s: Positive = 0.003  # vs: Stribeck velocity
    friction_N_m: Positive = 4e5  # sf: stiffness of the friction bristle before sliding
    friction_loss_per_K: NotNegative = 0.002  # fT: relative loss of friction per kelvin
    # Parameters of spring, offset and compliance
    spring_N_m: NotNegative = 1500.0  # k1: stiffness of a parallel spring
    offset_N: float = 6.0  # f0: constant force
    leak_N_s_m: Positive = 1.5e6  # c1: dashpot in series with yield and viscous force, for the oil compliance

    def __post_init__(self) -> None:
        check_parameters(self, self.name)

    @property
    def highest_A(self) -> float:
        """Largest current of tests and controllers."""
        return self.full_current_A

    def coil_resistance_ohm(self, temperature_degC: float) -> float:
        """Return the resistance of the coil [ohm] at a temperature."""
        return self.coil_ohm * (1.0 + self.copper_per_K * (temperature_degC + ZERO_CELSIUS_K - REFERENCE_K))

    def draw(self, rng: np.random.Generator, spread: float) -> LumpedDamper:
        """Return a variant with random factors, which are uniform from 1 - spread to 1 + spread.

        ``spread`` is 0 to 0.3. The name, ``full_current_A`` and the temperature coefficient of copper are not
        varied.
        """
        drawn = [each for each in fields_of(LumpedDamper) if each.name not in _OF_THE_KIND]
        factors = rng.uniform(1.0 - spread, 1.0 + spread, len(drawn)).tolist()
        changes = {}
        for each, factor in zip(drawn, factors, strict=True):
            most = each.option.most
            changes[each.name] = min(getattr(self, each.name) * factor, np.inf if most is None else most)
        return replace(self, **changes)


_NOMINAL = LumpedDamper()

_PRESETS = (
    # This preset reproduces the peak force and the thermal loss of force that the reference paper claims. The
    # function solve_thermal_claims() in tests/oracles/paper_preset.py computes yield_field_N and all later
    # parameters.
    replace(
        _NOMINAL, name="paper", coil_ohm=4.2, viscous_exponent=1.0, viscous_field=0.0, low_field_loss=0.0,
        viscosity_K=1435.5, viscosity_pole_K=0.0,
        yield_field_N=1052.836, viscous_N=58.81602, yield_loss_per_K=1.737544e-3,
        friction_loss_per_K=1.737544e-3,
    ),
    _NOMINAL,
    replace(
        _NOMINAL, name="hard", play_share=0.5, play_A=0.08, viscous_exponent=0.75, stiffness_N_m=8e5,
        stiffness_field_N_m=3e6, friction_N=85.0, friction_static=2.0, stribeck_m_s=0.004, leak_N_s_m=8e5,
        spread=0.27, asymmetry=0.03, position=0.06,
    ),
    replace(
        _NOMINAL, name="stiff", play_A=0.01, stiffness_N_m=1e7, stiffness_field_N_m=6e7, friction_N=10.0,
        leak_N_s_m=1e8, spread=0.0, asymmetry=0.0,
    ),
    # This preset is a damper for a quarter-car model.
    replace(
        _NOMINAL, name="vehicle", viscous_m_s=0.30, stiffness_N_m=4e5, stiffness_field_N_m=1.7e6,
        stribeck_m_s=0.02, friction_N_m=1e5, spring_N_m=0.0,
    ),
)  # fmt: skip

LUMPED: Mapping[str, LumpedDamper] = MappingProxyType({each.name: each for each in _PRESETS})
"""The lumped presets by name."""
