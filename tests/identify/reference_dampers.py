"""Dampers with known parameters, and simulated runs of these dampers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.signal import lsim

from mrdamper.data.prepare import Preparation, PreparedRun, prepare_run
from mrdamper.data.records import RigRun
from mrdamper.excitation import Harmonics, Motion, Sine, drive
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant, Exponential, Hill, ParameterLaw, Polynomial
from mrdamper.models.laws import find_law
from mrdamper.models.simulate import simulate

MOTIONS: Mapping[str, Motion] = {
    "sine 5 mm 1 Hz": Sine(5e-3, 1.0),
    "sine 10 mm 2 Hz": Sine(10e-3, 2.0),
    "harmonics": Harmonics((2e-3, 3e-3, 1.5e-3), (0.7, 1.9, 4.3), (0.3, 1.9, 4.1)),
}
COMMANDS = (0.0, 0.5, 1.0, 2.0)

# Smoothing is unnecessary because the displacement has no noise.
NO_SMOOTHING = Preparation(cutoff_Hz=math.inf, reference="none")

_C = Constant
_PARALLEL: Mapping[str, ParameterLaw] = {
    "viscosity": Polynomial((800.0, 600.0, -100.0)),
    "stiffness": Polynomial((1500.0, 400.0, -80.0)),
    "offset": Polynomial((40.0, 10.0, -3.0)),
    "yield_force": Polynomial((60.0, 600.0, -80.0)),
}
_FORMS: Mapping[str, Mapping[str, ParameterLaw]] = {
    "bouc-wen": {**_PARALLEL, "rho": _C(1800.0), "kappa": _C(-0.5), "n": _C(1.4)},
    "dahl": {**_PARALLEL, "rho": _C(2500.0)},
    "double-bouc-wen": {
        **_PARALLEL,
        "stiffness": _C(1500.0),
        "offset": Polynomial((40.0, 10.0)),
        "second_force": Polynomial((30.0, 250.0, -30.0)),
        "rho": Exponential(9000.0, -0.3),
        "second_rho": Exponential(1200.0, 0.2),
        "kappa": _C(-0.5),
        "n": _C(1.2),
    },
    "bouc-wen-saturating": {
        **_PARALLEL,
        "stiffness": _C(1500.0),
        "offset": Polynomial((40.0, 10.0)),
        "rate_force": Polynomial((50.0, 300.0, -30.0)),
        "saturation_velocity": _C(0.02),
        "rho": Exponential(2500.0, -0.3),
        "kappa": _C(-0.4),
        "n": _C(1.2),
    },
    "bingham": {**_PARALLEL, "yield_velocity": _C(0.006)},
    "tanh": {**_PARALLEL, "slope": _C(90.0), "shift": _C(0.4)},
    "lugre": {
        **_PARALLEL,
        "rho": _C(1800.0),
        "static_excess": _C(0.5),
        "fade_velocity": _C(0.02),
        "bristle_damping": _C(900.0),
    },
    "spencer": {
        "yield_force": Hill(90.0, 1100.0, 1.2, 1.6, 2.0),
        "series_damping": Exponential(2.5e4, 0.15),
        "inner_viscosity": Exponential(1800.0, 0.3),
        "inner_stiffness": _C(4000.0),
        "rho": _C(2500.0),
        "kappa": _C(-0.3),
        "n": _C(1.5),
        "offset": _C(-60.0),
        "stiffness": _C(600.0),
    },
    "series-valve": {
        "yield_force": Hill(90.0, 1100.0, 1.2, 1.6, 2.0),
        "thinning": _C(2.5),
        "thinning_exponent": _C(0.5),
        "yield_velocity": _C(3e-3),
        "position_gain": _C(-3.0),
        "gap_stiffness": _C(8e6),
        "gap": _C(1.5e-4),
        "gap_corner": _C(5e-5),
        "leak_damping": _C(2.5e4),
        "leak_exponent": _C(0.95),
        "offset": _C(40.0),
        "stiffness": _C(1500.0),
    },
    "chain": {
        "yield_force": Hill(90.0, 1100.0, 1.2, 1.6, 2.0),
        "yield_velocity": _C(3e-3),
        "thinning": _C(0.9),
        "thinning_exponent": _C(0.5),
        # The 99.5th percentile of the speed of the fastest motion in ``MOTIONS`` [m/s]
        "reference_speed": _C(0.1256637),
        "gap_stiffness": _C(8e6),
        "leak_damping": _C(2.5e4),
        "gap": _C(1.5e-4),
        "gap_corner": _C(5e-5),
        "offset": _C(40.0),
    },
}
REFERENCE_DAMPERS: Mapping[str, Damper] = {
    name: Damper(find_law(name), forms) for name, forms in _FORMS.items()
}


def simulate_runs(
    damper: Damper, *, noise: float, seed: int, duration: float = 4.0, rate_Hz: float = 500.0
) -> tuple[PreparedRun, ...]:
    """Return a run for each motion and current.

    ``noise`` is a fraction of the standard deviation of force.
    """
    rng = np.random.default_rng(seed)
    runs = []
    for label, motion in MOTIONS.items():
        for command in COMMANDS:
            path = drive(motion, duration=duration, rate_Hz=rate_Hz, command=command)
            force = simulate(damper, path)
            force = force + noise * np.std(force) * rng.standard_normal(len(force))
            run = RigRun(
                name=f"{label} {command:g} A",
                time=path.time,
                displacement=np.array(path.displacement),
                force=force,
                command=np.full(len(force), command),
                command_unit="A",
                session="rig",
                motion=label,
            )
            runs.append(prepare_run(run, NO_SMOOTHING))
    return tuple(runs)


TRUTH = REFERENCE_DAMPERS["bouc-wen"]


def changed(run: PreparedRun, kind: str, size: float, peak: float = 1.0) -> PreparedRun:
    """Return the run with a measurement error of the given kind and size.

    For ``force_saturation``, the measured force is too small by the fraction ``size`` if the true force
    equals ``peak``.
    """
    force, path = run.force, run.trajectory
    if kind == "force_gain":
        force = (1.0 + size) * force
    elif kind == "force_delay":
        force = np.interp(path.time - size, path.time, force)
    elif kind == "command_label":
        force = force + simulate(TRUTH, replace(path, command=path.command + size)) - simulate(TRUTH, path)
    elif kind == "force_saturation":
        force = force * (1.0 - size * (force / peak) ** 2)
    elif kind == "force_offset_of_run":
        force = force + size
    else:
        force = force[0] + lsim(([1.0], [size, 1.0]), force - force[0], path.time - path.time[0])[1]
    return replace(run, force=np.asarray(force))
