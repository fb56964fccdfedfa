"""Benchmarks of the identification: search methods, accuracy on virtual dampers, expected errors of cards.

    python -m bench fit                                        # variable projection and genetic algorithm
    python -m bench.fit accuracy hydraulic-bench nominal       # presets of the virtual rig
    python -m bench.fit accuracy hard --draws 1 3              # a preset and randomised dampers around it
    python -m bench.fit expected nominal --draws 1 3           # expected error versus error on new motions
    python -m bench.fit expected --runs DIR/utfsm_sine_*.csv   # the same comparison on measured runs

Even seeds of randomised dampers are for development, odd seeds for reports.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from statistics import median

import numpy as np

from bench.measure import Limit, Row, absent, ratios_of
from mrdamper.data.prepare import Preparation, PreparedRun, prepare_run
from mrdamper.data.readers import read_runs
from mrdamper.data.records import Dataset, RigRun
from mrdamper.errors import MissingExtraError, MrdamperError
from mrdamper.excitation import Chirp, Sine, drive
from mrdamper.identify.evaluate import prepare_all
from mrdamper.identify.fit import fit_law
from mrdamper.identify.fit_data import FitData
from mrdamper.identify.motions import folds_of, motion_groups
from mrdamper.identify.problem import FitProblem
from mrdamper.identify.scores import RunError, command_threshold, score_run
from mrdamper.identify.search.population import fit_genetic
from mrdamper.identify.search.variable_projection import fit_variable_projection
from mrdamper.identify.settings import FitSettings
from mrdamper.identify.templates import template
from mrdamper.jobs.fit import fit as fit_job
from mrdamper.jobs.options import FitOptions, RigOptions
from mrdamper.jobs.rig import RigResult, rig
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import open_drive, simulate
from mrdamper.virtual_rig.campaign import default_campaign
from mrdamper.virtual_rig.damper import draw_variant, find_preset
from mrdamper.virtual_rig.measurement import measure

# ------------------------------------------------------------------------------------ search methods

GROUP = "a campaign of 12 runs, 2 % noise, 14 free parameters"
CURRENTS_A, TEMPERATURES_degC = (0.0, 1.0, 2.0), (20.0, 40.0, 60.0, 80.0)
SAMPLES, RATE_Hz, NOISE_RATIO, SEEDS = 1000, 200.0, 0.02, 5
COST_RATIO_MAX = 1.01  # A search is successful if its cost / cost of the true parameters is at most this.
REFERENCE = {
    "viscosity.c0": 900.0,
    "viscosity.c1": 150.0,
    "stiffness.value": 800.0,
    "offset.c0": 12.0,
    "offset.c1": 4.0,
    "yield_force.base": 60.0,
    "yield_force.gain": 700.0,
    "yield_force.half_command": 1.1,
    "rho.at_zero": 1900.0,
    "rho.rate": -0.15,
    "kappa.value": -0.45,
    "n.value": 1.5,
    "viscosity.activation_K": 1200.0,
    "yield_force.temperature_slope": -0.0015,
}


def campaign(seed: int) -> tuple[FitProblem, float]:
    """Return a fit problem for simulated noisy runs, and the cost [%] of the true parameters."""
    plain = _runs(None, np.random.default_rng(0))
    reference = template("bouc-wen", plain, terms=())[0].with_parameters(REFERENCE)
    runs = _runs(reference, np.random.default_rng(seed))
    damper, free = template("bouc-wen", runs, terms=())
    settings = FitSettings(rate_Hz=RATE_Hz, samples_per_period=1e9)
    problem = FitProblem(damper, free, tuple(runs), settings=settings)
    errors = [
        (run.weight, (simulate(reference, run.drive) - run.force)[run.start :]) for run in problem.windows()
    ]
    return problem, float(np.sqrt(sum(weight * (error @ error) for weight, error in errors)))


def _runs(damper: Damper | None, rng: np.random.Generator) -> list[PreparedRun]:
    """Simulate the runs of a damper; None: return plausible runs for ``template``."""
    runs = []
    for current in CURRENTS_A:
        for degrees in TEMPERATURES_degC:
            kelvin = np.full(SAMPLES, 273.15 + degrees)
            path = replace(
                drive(Sine(0.010, 1.5), duration=(SAMPLES - 1) / RATE_Hz, rate_Hz=RATE_Hz, command=current),
                temperature=kelvin,
            )
            force = 800.0 * path.velocity + (100.0 + 400.0 * current) * np.tanh(path.velocity / 0.01)
            if damper is not None:
                force = simulate(damper, open_drive(path))
                force = force + NOISE_RATIO * float(np.std(force)) * rng.standard_normal(SAMPLES)
            name, time_s = f"run_{current:g}A_{degrees:g}C", np.arange(SAMPLES, dtype=np.float64) / RATE_Hz
            run = RigRun(name, time_s, path.displacement, force, path.command, "A", path.velocity, kelvin)
            runs.append(prepare_run(run))
    return runs


VARIABLE_PROJECTION = "variable projection, 5 starts"
SEARCHES: dict[str, Callable[[FitProblem, int], float]] = {
    VARIABLE_PROJECTION: lambda problem, _: fit_variable_projection(problem, starts=5).cost_percent,
    "genetic algorithm, pymoo, 200 x 300": lambda problem, seed: (
        fit_genetic(problem, population=200, generations=300, seed=seed).cost_percent
    ),
}


def run() -> list[Row]:
    """Return CPU time and cost of each search method. For each seed, all methods run one after the other."""
    SEARCHES[VARIABLE_PROJECTION](campaign(0)[0], 0)  # The first call loads libraries.
    spent: dict[str, list[float]] = {name: [] for name in SEARCHES}
    costs: dict[str, list[float]] = {name: [] for name in SEARCHES}
    missing: dict[str, Row] = {}
    for seed in range(SEEDS):
        problem, floor_percent = campaign(seed)
        for name in SEARCHES.keys() - missing.keys():
            begin = time.process_time()
            try:
                costs[name].append(SEARCHES[name](problem, seed) / floor_percent)
            except MissingExtraError as fault:
                missing[name] = absent(name, fault, GROUP)
                continue
            spent[name].append(time.process_time() - begin)
    rows = []
    for name in SEARCHES:
        if name in missing:
            rows.append(missing[name])
            continue
        count = sum(each <= COST_RATIO_MAX for each in costs[name])
        accuracy = (
            f"{count} of {SEEDS} seeds within 1 % of the floor; cost {median(costs[name]):.4g} x the floor"
        )
        ratios = ratios_of(spent[name], spent[VARIABLE_PROJECTION])
        limit = Limit(
            "variable projection: seeds within 1 % of the floor", SEEDS, count, "-", is_minimum=True
        )
        limits = (limit,) if name == VARIABLE_PROJECTION else ()
        rows.append(Row(name, tuple(spent[name]), None, ratios, accuracy, limits, GROUP))
    return rows


# ------------------------------------------------------------------------------------ virtual dampers


def accuracy_line(preset: str, seed: int | None) -> str:
    """Fit a card with default options; return held-out errors [%] by kind of run.

    The four kinds are: constant current above zero (without chirps), any constant current (without chirps),
    chirps above zero current, and random motion with random current. The error of the last kind is RMS error
    / RMS force. The other errors are nRMSE.
    """
    tests = rig(RigOptions(preset=preset, draw=seed))
    try:
        result = fit_job(tests.dataset, options=FitOptions(hold_out=tests.campaign.hold_out))
    except MrdamperError as error:
        return f"{tests.damper.name}: no card: {error}"
    errors = [each for each in result.assessment.runs if each.split == "held_out"]
    cells = "  ".join(_errors_by_kind(tests, errors))
    return f"{tests.damper.name}, {result.card().damper.law.name}: {cells}  {result.cpu_s:.1f} s"


def _errors_by_kind(tests: RigResult, errors: list[RunError]) -> list[str]:
    planned = {each.plan.name: each for each in tests.runs}
    least = command_threshold(each.command for each in errors)
    steady = [each for each in errors if each.command is not None]
    chirp = [each for each in steady if isinstance(planned[each.name].plan.motion, Chirp)]
    known = [each for each in steady if each not in chirp]
    random = [
        100.0 * each.rmse_N / float(np.sqrt(np.mean(planned[each.name].run.force ** 2)))
        for each in errors
        if planned[each.name].plan.label == "random"
    ]
    kinds = (
        [each.nrmse_percent for each in known if (each.command or 0.0) > least],
        [each.nrmse_percent for each in known],
        [each.nrmse_percent for each in chirp if (each.command or 0.0) > least],
        random,
    )
    return [f"{np.median(kind):.1f}/{max(kind):.1f}" if kind else "-" for kind in kinds]


# ------------------------------------------------------------------------------------ expected errors


@dataclass(frozen=True)
class HeldOutMotion:
    """Expected error of a card that was fitted without one motion, and measured errors on this motion."""

    expected_percent: float
    found_percent: tuple[float, ...]
    covered_percent: tuple[float, ...]


def held_out_motions(runs: Sequence[RigRun], *, by_motion: bool) -> list[HeldOutMotion]:
    """Hold out each motion (or fold of motions); return the expected and the measured errors."""
    prepared = prepare_all(runs, Preparation())
    raw = {run.name: run for run in runs}
    held_out = motion_groups(prepared) if by_motion else [fold.runs for fold in folds_of(prepared)]
    results = []
    for indices in held_out:
        kept = tuple(raw[run.name] for k, run in enumerate(prepared) if k not in set(indices))
        fitted = fit_law(FitData.prepare(Dataset(kept)))
        assert fitted.force_band is not None
        errors = [score_run(fitted.damper, prepared[k], band=fitted.force_band) for k in indices]
        covered = tuple(error.in_band_percent or 0.0 for error in errors)
        found = tuple(error.nrmse_percent for error in errors)
        results.append(HeldOutMotion(fitted.force_band.expected_nrmse_percent, found, covered))
    return results


def randomised_runs(preset: str, seed: int) -> list[RigRun]:
    """Return the runs at constant current of a randomised damper, or of the preset if the seed is 0."""
    damper = draw_variant(find_preset(preset), seed) if seed else find_preset(preset)
    default = default_campaign(damper)
    more = () if "monotube" in preset else ("sine:8mm:0.5Hz", "sine:4mm:1.5Hz")
    plan = replace(
        default,
        motions=(*default.motions, *more),
        currents_A=default.currents_A[::2],
        temperatures_degC=(20.0, 70.0, 120.0),
        held_out_temperatures_degC=(),
        held_out_motions=(),
        duration_s=3.0,
        steps=None,
        random=None,
    )
    return [run for run, _ in measure(damper, plan, seed=seed)]


def expected_line(name: str, runs: Sequence[RigRun], *, by_motion: bool) -> str:
    """Return a line with force-band coverage, expected error and measured error on held-out motions."""
    results = held_out_motions(runs, by_motion=by_motion)
    covered = np.concatenate([each.covered_percent for each in results])
    found = float(np.median(np.concatenate([each.found_percent for each in results])))
    expected = float(np.mean([each.expected_percent for each in results]))
    return (
        f"{name:24s} covered {covered.mean():.1f} % (lowest {covered.min():.0f}), expected {expected:.2f} %, "
        f"found {found:5.2f} %, ratio {found / expected:4.2f}"
    )


def main() -> None:
    """Print one line for each damper."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("kind", choices=("accuracy", "expected"))
    parser.add_argument("presets", nargs="*")
    parser.add_argument("--draws", nargs="*", type=int, default=[], help="seeds of randomised dampers")
    parser.add_argument("--runs", nargs="*", default=[], help="files of measured runs")
    arguments = parser.parse_args()
    if arguments.runs:
        print(expected_line("runs", list(read_runs(arguments.runs)), by_motion=False))
    for preset in arguments.presets:
        for seed in arguments.draws or [0]:
            if arguments.kind == "accuracy":
                print(accuracy_line(preset, seed or None), flush=True)
            else:
                runs = randomised_runs(preset, seed)
                print(expected_line(f"{preset} {seed}", runs, by_motion=True), flush=True)


if __name__ == "__main__":
    main()
