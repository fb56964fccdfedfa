"""Parameters of the hydraulic virtual damper, and two presets.

The hydraulic damper simulates pressures, volume flows, magnetic flux and the moving mass. The equations are
described in ``docs/hydraulic_rig.md`` and solved in ``native/hydraulic.c``. They differ from all identified
laws. The values of the presets are typical of dampers of this size and were not measured.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Annotated, ClassVar

import numpy as np

from mrdamper.quantities import REFERENCE_K, ZERO_CELSIUS_K
from mrdamper.schema import NotNegative, Option, Positive
from mrdamper.virtual_rig.lumped import check_parameters

_Share = Annotated[float, Option(least=0.0, most=1.0)]

# Parameters that vary in a randomised damper. The names in one tuple have a common random factor.
_DRAWN = (
    ("bore_m",), ("rod_m",), ("gap_m",), ("active_m",), ("passive_m",), ("bypass_m2",), ("air",),
    ("bulk_Pa",), ("gas_m3",), ("gas_Pa",), ("yield_Pa",), ("viscosity_scale",), ("turns",), ("coil_ohm",),
    ("shell_1_siemens", "shell_2_siemens", "shell_3_siemens"), ("supply_low_V", "supply_V"),
    ("friction_N",), ("friction_N_m",), ("joint_gap_m",), ("pin_N", "joint_N_m", "joint_N_m3"),
    ("piston_kg",),
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class HydraulicDamper:
    """Parameters of the hydraulic damper in SI units; the defaults are the preset ``hydraulic-bench``.

    The comments give the symbols of the equations in ``docs/hydraulic_rig.md``. Temperature-dependent values
    apply at 20 degC.

    Raises
    ------
    InputError
        If a parameter is not finite or outside its range, or the name is invalid in a file name.
    """

    kind: ClassVar[str] = "hydraulic"  # kind of the damper in the C extension

    name: str = "hydraulic-bench"  # prefix of the run names
    # Parameters of cylinder, fluid compressibility and gas
    bore_m: Positive = 0.040
    rod_m: Positive = 0.016
    through_rod: bool = True  # True: the rod passes through both chambers
    chamber_1_m: Positive = 0.045  # length of the chamber on the rod side at x = 0
    chamber_2_m: Positive = 0.045  # length of the opposite chamber at x = 0
    gas_m3: NotNegative = 0.0  # Vg0: volume of the gas charge at 20 degC and x = 0; zero: no gas charge
    gas_Pa: NotNegative = 0.0  # pg0: pressure of the gas charge at 20 degC and x = 0
    gas_exponent: Annotated[float, Option(least=1.0)] = 1.4  # adiabatic exponent of the gas
    gas_exchange_s: Positive = 4.0  # taug: time constant of heat transfer between gas and wall
    rest_Pa: NotNegative = 1.2e6  # p00: pressure at rest of a damper that has no gas charge
    rest_Pa_K: NotNegative = 8000.0  # kp0: increase of the pressure at rest per kelvin
    air: Annotated[float, Option(above=0.0, below=1.0)] = 0.005  # volume fraction of bubbles at 1 atm
    bulk_Pa: Positive = 1.5e9  # El0: bulk modulus of the liquid
    bulk_per_K: NotNegative = 0.0045  # kE: the bulk modulus at dT above 20 degC is El0 exp(-kE dT)
    expansion_per_K: NotNegative = 6e-4  # alT: thermal expansion of the fluid
    # Parameters of the valve (annular gap)
    slot_diameter_m: Positive = 0.034  # mean diameter of the annular gap; its circumference is wv
    gap_m: Positive = 7e-4  # hg: height of the annular gap
    active_m: Positive = 0.010  # La: length of the gap under the poles
    passive_m: Positive = 0.026  # Lp: length of the gap outside the poles
    entrance_loss: NotNegative = 1.5  # zeta: loss coefficient at the entrance of the gap
    bypass_m2: NotNegative = 2e-7  # CdAb: discharge coefficient times area of the bypass
    bypass_Pa: Positive = 2000.0  # dp0: the bypass flow is laminar below this pressure difference
    # Parameters of the fluid
    density_kg_m3: Positive = 3000.0  # rho: density of the fluid
    carrier_kg_m3: Positive = 900.0  # rhoc: density of the carrier liquid
    # phi20: volume fraction of the iron particles at 20 degC
    particle_share: Annotated[float, Option(above=0.0, below=0.6)] = 0.32
    # Viscosity nu of the carrier liquid: log10 log10(nu + 0.7 cSt) = Aw - Bw log10 T (ASTM D341)
    walther_a: Positive = 2.863929
    walther_b: Positive = 1.028887
    viscosity_scale: Positive = 1.0  # The viscosity is multiplied by this factor.
    flow_index: Positive = 0.92  # nhb: exponent of the Herschel-Bulkley law
    flow_rate_1_s: Positive = 1000.0  # gref: shear rate at which a Bingham fluid has the same stress
    creep: Positive = 300.0  # viscosity before yield divided by the viscosity after yield
    # The passive part of the gap has cinf + cv / (1 + lam * shear rate) times the viscosity of the fluid.
    passive_least: NotNegative = 0.8  # cinf: viscosity ratio at infinite shear rate
    passive_thinning: NotNegative = 1.0  # cv: decrease of the viscosity ratio by shear thinning
    passive_s: NotNegative = 0.002  # lam: half of the decrease is reached at the shear rate 1 / lam
    yield_Pa: NotNegative = 52e3  # ts: yield stress at magnetic saturation
    yield_A_m: Positive = 90e3  # Ha: the yield stress at field strength H is ts (1 - exp(-(H / Ha)^1.5))
    yield_least_Pa: Positive = 25.0  # t00: yield stress without magnetic field
    fade_degC: float = 185.0  # Tm: centre of the decrease of the yield stress with temperature
    fade_K: Positive = 33.0  # wm: width of the decrease of the yield stress with temperature
    fluid_T: Positive = 0.62  # Js: saturation polarisation of the fluid
    fluid_A_m: Positive = 85e3  # Hsf: field strength at half of the saturation polarisation
    fluid_lag_s: Positive = 8e-4  # tauf: time constant with which the fluid structure follows the flux
    # Parameters of coil, magnet and driver
    turns: Positive = 190.0  # Nt: number of turns of the coil
    coil_ohm: Positive = 5.0  # R20: coil resistance at 20 degC
    copper_per_K: NotNegative = 0.00393
    leakage_henry: Positive = 0.002  # Ls: leakage inductance
    shell_1_siemens: Positive = 1000.0  # G1: eddy-current conductance of the outer third of the magnet
    shell_2_siemens: Positive = 2000.0
    shell_3_siemens: Positive = 2000.0
    steel_per_K: NotNegative = 0.0045
    core_m2: Positive = 4.2e-4  # Ac: cross-section of the core
    pole_m2: Positive = 9.6e-4  # Ag: area of a pole
    core_m: Positive = 0.09  # lc: length of the flux path in the steel
    permeability: Positive = 900.0  # mur: relative permeability of the steel
    knee_T: Positive = 1.45  # Bk: flux density at which saturation doubles the field strength in the steel
    knee_exponent: Positive = 9.0  # ns: the field strength in the steel grows by the factor 1 + (B / Bk)^ns
    stop_1_T: Positive = 0.05  # r1: half width of the first stop operator of the magnetic hysteresis
    stop_2_T: Positive = 0.35
    stop_1_A_m: NotNegative = 60.0  # a1: field strength that the first stop operator adds at its limit
    stop_2_A_m: NotNegative = 110.0
    stop_lag_s: Positive = 3e-4  # taum: time constant of the magnetic viscosity
    driver_V_A: NotNegative = 20.0  # Kp: proportional gain of the current controller
    driver_V_A_s: NotNegative = 3000.0  # Ki: integral gain of the current controller
    driver_release_1_s: NotNegative = 400.0  # Kaw: gain of the anti-windup (back-calculation) of the integral
    supply_low_V: Annotated[float, Option(most=0.0)] = -24.0  # Vlo: lower voltage limit; 0: single quadrant
    supply_V: Positive = 24.0  # Vhi: upper voltage limit
    highest_A: Positive = 2.5  # Imax: the driver limits the command to this current
    command_lag_s: Positive = 3e-4  # tauc: lag of the command
    # Parameters of piston, joint and seal
    piston_kg: Positive = 0.45  # ms: moving mass
    pin_N: NotNegative = 2e9  # kH [N/m^1.5]: contact stiffness of the pin in the joint between rod and piston
    pin_s_m: NotNegative = 0.15  # alh: damping of the contact of the pin (Hunt-Crossley)
    joint_gap_m: NotNegative = 1.5e-5  # gapj: free play of the joint
    joint_N_m: NotNegative = 0.0  # kb: linear stiffness of a rubber joint
    joint_N_m3: NotNegative = 0.0  # k3: cubic stiffness of a rubber joint
    joint_N_s_m: NotNegative = 800.0  # cb: damping of the joint
    friction_N: NotNegative = 38.0  # Fc: sliding friction of the seal
    friction_static: Annotated[float, Option(least=1.0)] = 1.5  # sr: static divided by sliding friction
    stribeck_m_s: Positive = 0.004  # vs: Stribeck velocity
    friction_1_Pa: NotNegative = 1.5e-7  # kps: relative increase of friction per pascal on the seal
    friction_share: _Share = 0.5  # wps: weight of chamber 1 in the pressure on the seal
    friction_N_m: Positive = 6e5  # kf: stiffness of the friction elements before sliding
    friction_N_s_m: Positive = 400.0  # cf: damping of the friction elements during sliding
    friction_per_K: NotNegative = 0.0015  # fT: relative decrease of friction per kelvin

    def __post_init__(self) -> None:
        check_parameters(self, self.name)

    def coil_resistance_ohm(self, temperature_degC: float) -> float:
        """Return the resistance of the coil [ohm] at a temperature."""
        return self.coil_ohm * (1.0 + self.copper_per_K * (temperature_degC + ZERO_CELSIUS_K - REFERENCE_K))

    def draw(self, rng: np.random.Generator, spread: float) -> HydraulicDamper:
        """Return a variant with random factors, which are log-uniform from 1 / (1 + spread) to 1 + spread.

        Bore, rod, gap height and lengths, bypass, air, bulk modulus, gas, yield stress, viscosity, turns,
        resistance, eddy currents, supply, seal, joint and mass are varied. Areas and volumes follow from
        these parameters.
        """
        widest = np.log1p(spread)
        factors = np.exp(rng.uniform(-widest, widest, len(_DRAWN))).tolist()
        changes = {
            name: getattr(self, name) * factor
            for names, factor in zip(_DRAWN, factors, strict=True)
            for name in names
        }
        return replace(self, **changes)


_BENCH = HydraulicDamper()

_PRESETS = (
    _BENCH,  # bench damper with a through-rod
    # This preset is a monotube car damper with a gas charge of 28 bar and a single-quadrant driver.
    replace(
        _BENCH, name="hydraulic-monotube", bore_m=0.046, rod_m=0.0124, through_rod=False, chamber_1_m=0.100,
        chamber_2_m=0.080, gas_m3=7e-5, gas_Pa=2.8e6, gas_exchange_s=3.0, rest_Pa=0.0, rest_Pa_K=0.0,
        slot_diameter_m=0.040, gap_m=9e-4, active_m=0.0195, passive_m=0.022, bypass_m2=1.6e-6,
        walther_a=4.558556, walther_b=1.745927, yield_Pa=48e3, turns=110.0, coil_ohm=1.15, leakage_henry=3e-4,
        shell_1_siemens=900.0, shell_2_siemens=1600.0, shell_3_siemens=1600.0,
        core_m2=5.6e-4, pole_m2=1.25e-3, core_m=0.11,
        stop_1_T=0.06, stop_2_T=0.40, stop_1_A_m=80.0, stop_2_A_m=140.0, driver_V_A=6.0, driver_V_A_s=1200.0,
        driver_release_1_s=600.0, supply_low_V=0.0, supply_V=12.0, highest_A=5.5, piston_kg=0.55, pin_N=0.0,
        joint_gap_m=0.0, joint_N_m=3.5e6, joint_N_m3=2e12, joint_N_s_m=900.0, friction_N=55.0,
        stribeck_m_s=0.012, friction_1_Pa=1.2e-7, friction_share=1.0, friction_N_m=3e5, friction_N_s_m=250.0,
    ),
)  # fmt: skip

HYDRAULIC: Mapping[str, HydraulicDamper] = MappingProxyType({each.name: each for each in _PRESETS})
"""The hydraulic presets by name."""
