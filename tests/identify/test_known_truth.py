"""Fits recover the known parameters of a damper within their standard errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from mrdamper.data.prepare import Preparation, PreparedRun, prepare_run
from mrdamper.data.records import RigRun
from mrdamper.excitation import Sine, drive
from mrdamper.identify.problem import FitProblem, SearchResult
from mrdamper.identify.search.variable_projection import fit_variable_projection
from mrdamper.identify.settings import FitSettings
from mrdamper.identify.templates import template
from mrdamper.models.damper import LAG, Damper
from mrdamper.models.dependence import Bipolynomial, Constant
from mrdamper.models.simulate import simulate
from tests.identify.reference_dampers import COMMANDS, NO_SMOOTHING, REFERENCE_DAMPERS, simulate_runs
from tests.support.warm import warm_damper, warm_runs

NOISE = 0.02


def identify(law: str, seed: int) -> SearchResult:
    runs = simulate_runs(REFERENCE_DAMPERS[law], noise=NOISE, seed=seed)
    damper, free = template(law, runs)
    return fit_variable_projection(
        FitProblem(
            damper,
            free,
            runs,
            settings=FitSettings(rate_Hz=500.0 if law == "chain" else 200.0, samples_per_period=1e9),
        ),
        starts=3 if law in ("series-valve", "chain") else 1,
    )


def errors_from_the_truth(law: str, seeds: range) -> dict[str, NDArray[np.float64]]:
    """Return the errors of each identifiable parameter for all seeds, in units of its standard error.

    A parameter is included if it is identifiable for more than half of the seeds. A decision for each seed
    would select the seeds whose noise has made the parameter large.
    """
    truth: Damper = REFERENCE_DAMPERS[law]
    off: dict[str, list[float]] = {}
    identifiable: dict[str, int] = {}
    for seed in seeds:
        result = identify(law, seed)
        assert result.cost_percent == pytest.approx(100 * NOISE, rel=0.04), (
            f"seed {seed}: not the noise floor"
        )
        for e in result.estimates:
            off.setdefault(e.name, []).append(abs(e.value - truth.parameters[e.name]) / e.standard_error)
            identifiable[e.name] = identifiable.get(e.name, 0) + e.identifiable
    return {name: np.array(off[name]) for name, count in identifiable.items() if count > len(seeds) / 2}


@pytest.mark.nightly
@pytest.mark.parametrize("law", REFERENCE_DAMPERS)
def test_twenty_noisy_campaigns_recover_parameters(law: str) -> None:
    """At least 19 of 20 estimates of each parameter deviate by less than 3 standard errors."""
    off = errors_from_the_truth(law, range(20))
    shares = {name: float(np.mean(z < 3.0)) for name, z in off.items()}
    _, free = template(law, simulate_runs(REFERENCE_DAMPERS[law], noise=0.0, seed=0))
    # Many parameters of the chain are not identifiable because most of its terms are disabled.
    assert len(shares) > len(free) // 3
    assert min(shares.values()) >= 0.95, shares
    assert np.mean(list(shares.values())) >= 0.97


@pytest.mark.release
@pytest.mark.parametrize("law", REFERENCE_DAMPERS)
def test_two_hundred_noisy_campaigns_recover_parameters(law: str) -> None:
    """At least 97 % of the estimates are within 3 standard errors.

    The standard errors equal the real scatter.
    """
    off = errors_from_the_truth(law, range(200))
    shares = {name: float(np.mean(z < 3.0)) for name, z in off.items()}
    assert min(shares.values()) >= 0.97, shares
    scatter = {name: float(np.sqrt(np.mean(z**2))) for name, z in off.items()}
    assert all(0.8 < size < 1.2 for size in scatter.values()), scatter


@pytest.mark.nightly
@pytest.mark.parametrize("law", REFERENCE_DAMPERS)
def test_fitted_parameters_are_exact_without_noise(law: str) -> None:
    """Parameters deviate by at most 2 %, or 0.1 % if they are zero.

    A friction that does not exist is fitted as the smallest allowed value, 1e-5 of the largest force. The
    stiffness of this friction is then arbitrary.
    """
    runs = simulate_runs(REFERENCE_DAMPERS[law], noise=0.0, seed=0)
    greatest = max(float(np.abs(run.run.force).max()) for run in runs)
    damper, free = template(law, runs)
    result = fit_variable_projection(
        FitProblem(damper, free, runs, settings=FitSettings(rate_Hz=500.0, samples_per_period=1e9)),
        starts=3,
    )
    assert result.cost_percent < 0.05
    for estimate in result.estimates:
        truth = REFERENCE_DAMPERS[law].parameters[estimate.name]
        nil = 2e-5 * greatest if estimate.name == "friction_force.value" else 1e-3 * max(1.0, abs(truth))
        if estimate.name != "friction_stiffness.value":
            assert estimate.value == pytest.approx(truth, rel=0.02, abs=nil), estimate.name


def test_lag_is_recovered_from_changing_current() -> None:
    """If the current changes, the fit identifies the lag between current and force like a parameter."""
    truth = replace(REFERENCE_DAMPERS["bouc-wen-saturating"], command_lag_s=0.012)
    time = np.arange(4001) * 0.002
    command = np.where((time % 1.3) < 0.6, 2.0, 0.5) * (time > 0.4)
    path = drive(Sine(8e-3, 1.1), duration=8.0, rate_Hz=500.0, command=command)
    clean = simulate(truth, path)
    rng = np.random.default_rng(3)
    run = RigRun(
        name="steps of current",
        time=path.time,
        displacement=np.array(path.displacement),
        force=clean + NOISE * np.std(clean) * rng.standard_normal(len(clean)),
        command=np.array(path.command),
        command_unit="A",
    )
    runs = (*simulate_runs(truth, noise=NOISE, seed=3), prepare_run(run, NO_SMOOTHING))
    damper, free = template("bouc-wen-saturating", runs)
    problem = FitProblem(damper, free, runs)
    result = fit_variable_projection(problem, starts=2)
    lag = next(e for e in result.estimates if e.name == LAG)
    assert abs(result.damper.command_lag_s - 0.012) < 3.0 * lag.standard_error
    assert lag.standard_error < 0.05 * 0.012


def test_added_friction_and_mass_are_recovered() -> None:
    added = {"coulomb_friction": 60.0, "breakaway_friction": 40.0, "mass": 6.0}
    added |= {"stribeck_velocity": 8e-3, "transition_velocity": 1e-3}
    forms = {
        **REFERENCE_DAMPERS["dahl"].coefficients,
        **{name: Constant(value) for name, value in added.items()},
    }
    runs = simulate_runs(replace(REFERENCE_DAMPERS["dahl"], coefficients=forms), noise=NOISE, seed=5)
    damper, free = template("dahl", runs, terms=("friction", "mass"))
    result = fit_variable_projection(FitProblem(damper, free, runs), starts=2)
    assert result.cost_percent == pytest.approx(100 * NOISE, rel=0.04)
    for estimate in result.estimates:
        name = estimate.name.removesuffix(".value")
        if name in added and estimate.identifiable:
            assert abs(estimate.value - added[name]) < 3.0 * estimate.standard_error, name


@pytest.mark.parametrize(("stroke", "force"), [(0.05, 4e-2), (20.0, 400.0)])
def test_damper_of_any_size_is_fitted(stroke: float, force: float) -> None:
    """Bounds and starting values scale with stroke and force, from 20 N at 0.5 mm to 200 kN at 200 mm."""
    truth = REFERENCE_DAMPERS["chain"]
    here = fit_chain(simulate_runs(truth, noise=NOISE, seed=1))
    there = fit_chain(resized(simulate_runs(truth, noise=NOISE, seed=1), stroke, force))
    assert there.cost_percent == pytest.approx(here.cost_percent, rel=1e-4)
    units = truth.units
    for found, other in zip(here.estimates, there.estimates, strict=True):
        sizes = {"N": force, "m": stroke, "m/s": stroke, "N/m": force / stroke}
        size = sizes.get(units[found.name], 1.0)
        size = force / stroke if found.name.startswith("leak_damping") else size
        within = 0.02 * found.standard_error * size
        assert other.value == pytest.approx(size * found.value, abs=within), found.name


def fit_chain(runs: tuple[PreparedRun, ...]) -> SearchResult:
    damper, free = template("chain", runs, terms=())
    return fit_variable_projection(FitProblem(damper, free, runs), dampers=[damper])


def resized(runs: tuple[PreparedRun, ...], stroke: float, force: float) -> tuple[PreparedRun, ...]:
    return tuple(
        prepare_run(
            replace(r.run, displacement=stroke * r.run.displacement, force=force * r.run.force), NO_SMOOTHING
        )
        for r in runs
    )


def test_temperature_dependent_gas_spring_is_recovered() -> None:
    """Force and stiffness of the gas spring at 20 degC and their changes with temperature are recovered."""
    gas = {"offset": Bipolynomial((-300.0, -1.02), 1), "stiffness": Bipolynomial((900.0, 3.1), 1)}
    gassy = replace(warm_damper(), coefficients={**warm_damper().coefficients, **gas})
    runs = [prepare_run(run, NO_SMOOTHING) for run in warm_runs(gassy, seed=3)]
    damper, free = template("dahl", runs, terms=("gas",))
    result = fit_variable_projection(FitProblem(damper, free, tuple(runs)), starts=2)
    found = {estimate.name: estimate for estimate in result.estimates}
    for name in ("offset.c00", "offset.c01", "stiffness.c00", "stiffness.c01"):
        true = gassy.parameters[name]
        assert abs(found[name].value - true) < 4.0 * found[name].standard_error < abs(true), name


@pytest.mark.parametrize("noise", [2e-5, 1e-4])
def test_displacement_noise_does_not_bias_exponent(noise: float) -> None:
    """Noise causes false reversals. Smoothing and a dead band still give the true exponent n = 1.6.

    Without smoothing and dead band, 0.1 mm of noise biases n, and 0.02 mm makes n uncertain.
    """
    truth = replace(
        REFERENCE_DAMPERS["bouc-wen"],
        coefficients={**REFERENCE_DAMPERS["bouc-wen"].coefficients, "n": Constant(1.6)},
    )
    rough = Preparation(cutoff_Hz=np.inf, dead_band_m=0.0)
    found = {}
    for label, preparation in (("prepared", None), ("rough", rough)):
        runs = noisy_displacement(truth, noise, preparation)
        damper, free = template("bouc-wen", runs)
        result = fit_variable_projection(FitProblem(damper, free, runs), starts=1)
        found[label] = next(e for e in result.estimates if e.name == "n.value")
    assert abs(found["prepared"].value - 1.6) < 3.0 * found["prepared"].standard_error
    assert found["prepared"].standard_error < 0.05
    assert found["rough"].standard_error > 3.0 * found["prepared"].standard_error
    if noise == 1e-4:
        assert found["rough"].value > 2.5


def noisy_displacement(
    truth: Damper, noise: float, preparation: Preparation | None
) -> tuple[PreparedRun, ...]:
    rng = np.random.default_rng(0)
    runs = []
    for motion in (Sine(5e-3, 1.0), Sine(1e-2, 2.0)):
        for command in COMMANDS:
            path = drive(motion, duration=4.0, rate_Hz=1000.0, command=command)
            force = simulate(truth, path)
            run = RigRun(
                name=f"{motion} at {command:g} A",
                time=path.time,
                displacement=path.displacement + noise * rng.standard_normal(len(path)),
                force=force + NOISE * np.std(force) * rng.standard_normal(len(path)),
                command=path.command,
                command_unit="A",
            )
            runs.append(prepare_run(run, preparation))
    return tuple(runs)
