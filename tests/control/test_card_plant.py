"""A model card as plant of the control loop has the same force as the simulation of a whole run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mrdamper.control.card_plant import CardPlant
from mrdamper.errors import InputError
from mrdamper.excitation import MOTIONS, drive
from mrdamper.models.actuation import Actuation
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant, Hill, ParameterLaw, Polynomial, TemperatureDependent
from mrdamper.models.laws import LAWS
from mrdamper.models.simulate import simulate
from mrdamper.models.temperature import Arrhenius, Linear

FORMS: dict[str, ParameterLaw] = {
    "viscosity": TemperatureDependent(Polynomial((900.0, 300.0)), Arrhenius(1435.5)),
    "yield_force": TemperatureDependent(Hill(60.0, 1200.0, 1.2, 1.4), Linear(1.5e-3)),
    "second_force": Polynomial((10.0, 90.0)),
    "stiffness": Constant(1500.0),
    "offset": Constant(6.0),
    "mass": Constant(0.4),
    "coulomb_friction": Constant(30.0),
    "breakaway_friction": Constant(10.0),
    "viscous_exponent": Constant(0.9),
    "rho": Polynomial((3e3, -500.0)),
    "second_rho": Constant(600.0),
    "kappa": Constant(-0.8),
    "n": Constant(1.3),
    "rate_force": Constant(200.0),
    "saturation_velocity": Constant(0.01),
    "yield_velocity": Constant(2e-3),
    "slope": Constant(300.0),
    "shift": Constant(0.4),
    "thinning": TemperatureDependent(Constant(3.2), Arrhenius(600.0)),
    "thinning_exponent": Constant(0.43),
    "position_gain": Constant(-2.3),
    "gap_stiffness": Constant(1.2e7),
    "gap": Constant(1.67e-4),
    "gap_corner": Constant(4.6e-5),
    "leak_damping": TemperatureDependent(Constant(3e4), Arrhenius(1400.0)),
    "leak_exponent": Constant(0.95),
    "bristle_share": Constant(0.5),
    "friction_force": Constant(20.0),
    "series_damping": Constant(9e4),
    "inner_viscosity": Constant(800.0),
    "inner_stiffness": Constant(900.0),
    "static_excess": Constant(0.3),
    "fade_velocity": Constant(5e-3),
    "bristle_damping": Constant(100.0),
}


def damper(law="double-bouc-wen", *, lag=None, **changed):
    usual = {
        c.name: Constant(max(c.lower, 1.0) if c.default is None else c.default)
        for c in LAWS[law].coefficients
    }
    forms = {name: form for name, form in {**usual, **FORMS, **changed}.items() if name in usual}
    return Damper(LAWS[law], forms, actuation=lag, temperature_range=(288.15, 398.15))


def path(command):
    return drive(
        MOTIONS["nonperiodic"], duration=1.0, rate_Hz=10_000.0, command=command(np.arange(10_001) / 1e4),
        temperature=333.15,
    )  # fmt: skip


def in_blocks(plant, trajectory, size, degrees=60.0):
    cuts = range(0, len(trajectory), size)
    parts = (trajectory.displacement, trajectory.velocity, trajectory.command)
    return np.concatenate([plant.advance_many(*(p[k : k + size] for p in parts), degrees) for k in cuts])


def swing(t):
    return 1.0 - 0.9 * np.cos(2 * np.pi * 1.7 * t)


@pytest.mark.system
@pytest.mark.parametrize("law", list(LAWS))
def test_stepwise_plant_equals_causal_simulation(law):
    """The plant computes the acceleration from the velocity, which changes the force by less than 0.1 %."""
    whole = path(swing)
    expected = simulate(damper(law), whole, form="causal")
    force = in_blocks(CardPlant(damper(law)), whole, 10)
    assert np.abs(force - expected)[1:].max() < 1e-3 * np.abs(expected).max()


@pytest.mark.parametrize("width", [0.0, 0.05])
def test_plant_delays_current_like_causal_simulation(width):
    lag = Actuation(rise_s=0.009, fall_s=0.006, second_s=0.003, delay_s=0.0035, hysteresis_width_A=width)
    # The simulation assumes that the current was constant before the first sample.
    whole = path(lambda t: np.where(t < 0.2, 0.0, swing(t - 0.2)))
    expected = simulate(damper(lag=lag), whole, form="causal")
    force = in_blocks(CardPlant(damper(lag=lag)), whole, 10)
    # The plant keeps the command constant during a step, but the simulation interpolates the command. The
    # interpolated command changes half a step later.
    assert np.abs(force - expected)[1:].max() < 2e-3 * np.abs(expected).max()


@pytest.mark.system
@pytest.mark.parametrize("size", [pytest.param(1, marks=pytest.mark.nightly), 7, 1000])
def test_plant_force_is_independent_of_batch_size(size):
    lag = Actuation(rise_s=0.009, fall_s=0.006, second_s=0.003, delay_s=0.0035)
    whole = path(swing)
    together = in_blocks(CardPlant(damper(lag=lag)), whole, len(whole))
    # If the plant gets one sample per call, it detects a turning point only in the next call.
    near = 1e-6 * np.abs(together).max() if size == 1 else 1e-8
    assert in_blocks(CardPlant(damper(lag=lag)), whole, size) == pytest.approx(together, abs=near)


def test_copied_plant_is_independent():
    plant, whole = CardPlant(damper()), path(swing)
    in_blocks(plant, whole, 500)
    other = plant.copy()
    x, v = whole.displacement[:2000], whole.velocity[:2000]
    strong = other.advance_many(x, v, 2.0, 60.0)
    weak = plant.advance_many(x, v, 0.0, 60.0)
    assert np.abs(strong).max() > 2.0 * np.abs(weak).max()


def test_plant_rejects_unsuitable_law():
    own = replace(damper("bingham"), law=replace(LAWS["bingham"], name="own", kernel=None, python=object()))  # type: ignore[arg-type]  # never called
    for unsuitable, message in (
        (own, "which is in Python"),
        (damper(n=Polynomial((1.3, 0.1))), "n depends on"),
    ):
        with pytest.raises(InputError, match=message):
            CardPlant(unsuitable)


@pytest.mark.system
@pytest.mark.parametrize("exponent", [0.1, 1.2])
def test_series_valve_force_decays_at_rest(exponent):
    """The slope of the shear-thinning force is infinite at rest, but the solver returns a finite force."""
    t = 1e-4 * np.arange(12_000)
    x = 3e-3 * np.exp(-12.0 * t) * np.sin(60.0 * t)
    x[9000:] = x[9000]
    v = np.gradient(x, 1e-4)
    still = damper("series-valve", thinning_exponent=Constant(exponent), offset=Constant(0.0))
    for current in (0.0, 2.0):
        force = CardPlant(still).advance_many(x, v, current, 60.0)
        assert np.isfinite(force).all()
        assert np.abs(force[-1000:]).max() < 0.5 * np.abs(force).max()
