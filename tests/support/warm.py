"""Runs of a temperature-dependent damper for tests of reports: sines at three temperatures."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mrdamper.data.records import RigRun
from mrdamper.excitation import Motion, Sine, drive
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant, ParameterLaw, Polynomial, TemperatureDependent
from mrdamper.models.laws import LAWS
from mrdamper.models.simulate import simulate
from mrdamper.models.temperature import Arrhenius, Linear

MOTIONS: Mapping[str, Motion] = {"sine5mm1Hz": Sine(5e-3, 1.0), "sine3mm2Hz": Sine(3e-3, 2.0)}
CURRENTS = (0.0, 1.0, 2.0)
TEMPERATURES = (20.0, 60.0, 100.0)
NOISE_N = 4.0


def warm_damper(*, viscous_loss_K: float = 1435.5, yield_slope: float = 1e-3) -> Damper:
    """Return a Dahl damper whose viscosity (Arrhenius) and yield force (linear) decrease with temperature."""
    forms: dict[str, ParameterLaw] = {
        "viscosity": TemperatureDependent(Constant(5e3), Arrhenius(viscous_loss_K)),
        "yield_force": TemperatureDependent(Polynomial((60.0, 500.0)), Linear(yield_slope)),
        "rho": Constant(4e3),
        "offset": Constant(20.0),
    }
    return Damper(LAWS["dahl"], forms)


def warm_runs(damper: Damper, motions: Mapping[str, Motion] = MOTIONS, *, seed: int = 0) -> list[RigRun]:
    """Return one run for each motion, current and temperature [degC], with noise on the force."""
    rng = np.random.default_rng(seed)
    runs = []
    for degrees in TEMPERATURES:
        for current in CURRENTS:
            for name, motion in motions.items():
                path = drive(
                    motion, duration=3.0, rate_Hz=250.0, command=current, temperature=degrees + 273.15
                )
                force = simulate(damper, path) + NOISE_N * rng.standard_normal(len(path))
                runs.append(
                    RigRun(
                        name=f"rig_{degrees:03.0f}C_{current:.2f}A_{name}",
                        time=path.time,
                        displacement=np.array(path.displacement),
                        force=force,
                        command=np.array(path.command),
                        command_unit="A",
                        temperature=np.full(len(path), degrees + 273.15),
                    )
                )
    return runs
