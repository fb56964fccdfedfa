"""The identified model does not change if the data contain the same information in another form."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import mrdamper
from mrdamper.data.records import Dataset, RigRun
from mrdamper.excitation import Sine, drive
from mrdamper.jobs.fit import FitResult, fit
from mrdamper.jobs.inputs import read_dataset
from mrdamper.jobs.options import FitOptions
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant
from mrdamper.models.simulate import simulate
from mrdamper.virtual_rig.campaign import Campaign
from mrdamper.virtual_rig.lumped import LUMPED
from mrdamper.virtual_rig.measurement import measure
from tests.identify.reference_dampers import REFERENCE_DAMPERS

STANDARD_ERROR_RATIO_MAX = 0.05  # Parameters with a larger relative standard error are not compared.


@dataclass(frozen=True)
class Case:
    """Data set and the name of its hysteresis model. Without a name, the fit selects the model."""

    runs: Dataset
    hold_out: tuple[str, ...]
    law: str | None = None

    def fit(self, runs: Dataset | None = None, *, jobs: int = 1) -> FitResult:
        options = FitOptions(hold_out=self.hold_out, terms=None if self.law is None else ("none",), jobs=jobs)
        return fit(self.runs if runs is None else runs, self.law, options=options)


def short_campaign(preset: str, temperatures_degC: tuple[float, ...]) -> Dataset:
    """Return runs of three motions at three currents, 3 s each. The longest stroke is held out."""
    plan = Campaign(
        motions=("sine5mm1Hz", "sine3mm2Hz", "sine15mm1Hz"),
        currents_A=(0.0, 0.5, 2.0),
        temperatures_degC=temperatures_degC,
        held_out_motions=(),
        held_out_temperatures_degC=(),
        steps=None,
    )
    runs = (run for run, _ in measure(LUMPED[preset], plan, seed=3))
    return Dataset(tuple(run.between(0.0, 3.0) for run in runs))


@cache
def virtual_case(preset: str, temperatures_degC: tuple[float, ...]) -> Case:
    return Case(short_campaign(preset, temperatures_degC), ("*sine15mm1Hz*",))


# In these tests, the changed data lead to other terms of the hysteresis model or to another local minimum.
# The errors of the held-out runs or the well-determined parameters then change by more than the limits.
KNOWN_FAILURES = {
    ("test_file_units_hardly_change_fitted_model", "selected"),
    ("test_every_second_sample_gives_similar_model", "utfsm"),
    ("test_every_second_sample_gives_similar_model", "selected"),
    ("test_run_generated_by_model_hardly_changes_model", "selected"),
    ("test_run_generated_by_model_hardly_changes_model", "hard"),
}


@pytest.fixture(autouse=True)
def mark_known_failures(request: pytest.FixtureRequest) -> None:
    """Mark the known failures as expected. A marked test that passes counts as a failure."""
    name, _, parameter = request.node.name.partition("[")
    if (name, parameter.removesuffix("]")) in KNOWN_FAILURES:
        reason = "the model selection is not stable"
        request.applymarker(pytest.mark.xfail(reason=reason, strict=True))


@pytest.fixture(
    scope="module",
    params=[
        "small",
        pytest.param("selected", marks=pytest.mark.nightly),
        pytest.param("nominal", marks=pytest.mark.nightly),
        pytest.param("hard", marks=pytest.mark.nightly),
        pytest.param("utfsm", marks=pytest.mark.nightly),
    ],
)
def case(request: pytest.FixtureRequest) -> Case:
    """Return a data set. Fast tests use a fixed hysteresis law; nightly tests also select law and terms."""
    if request.param == "small":
        return replace(virtual_case("nominal", (20.0,)), law="bouc-wen")
    if request.param == "selected":
        return virtual_case("nominal", (20.0,))
    if request.param == "utfsm":
        folder: Path = request.getfixturevalue("real_data")
        runs = mrdamper.read_runs([str(folder / "dev" / "utfsm_sine_*.csv")])
        return Case(runs, (runs.names[-1],))
    return virtual_case(request.param, (20.0, 60.0))


@pytest.fixture(scope="module")
def fitted(case: Case) -> FitResult:
    return case.fit()


def held_out_percent(result: FitResult) -> float:
    """Return the root mean square of the relative errors [%] of the held-out runs."""
    errors = [error.nrmse_percent for error in result.assessment.runs if error.split == "held_out"]
    return float(np.sqrt(np.mean(np.square(errors))))


def assert_equal(first: FitResult, second: FitResult) -> None:
    """Check that two fits have the same hysteresis model and bit-identical parameters."""
    assert second.damper.law.name == first.damper.law.name
    assert dict(second.damper.parameters) == dict(first.damper.parameters)


def assert_close(
    first: FitResult,
    second: FitResult,
    *,
    error_percent: float,
    parameter_percent: float,
) -> None:
    """Check that terms, held-out errors and well-determined parameters of two fits are similar.

    Parameters
    ----------
    error_percent, parameter_percent : largest relative differences of held-out error and parameters [%]
    """
    assert second.damper.law.name == first.damper.law.name
    ratio = held_out_percent(second) / held_out_percent(first)
    differences = {
        each.name: 100.0 * abs(second.damper.parameters.get(each.name, np.inf) / each.value - 1.0)
        for each in first.estimates
        if each.standard_error < STANDARD_ERROR_RATIO_MAX * abs(each.value)
    }
    assert 100.0 * abs(ratio - 1.0) <= error_percent
    assert {name: d for name, d in differences.items() if d > parameter_percent} == {}


def map_runs(runs: Dataset, change: Callable[[RigRun], RigRun]) -> Dataset:
    return Dataset(tuple(change(run) for run in runs))


def written(runs: Dataset, folder: Path, *, in_millimetres: bool = False, force_sign: float = 1.0) -> Dataset:
    """Write runs to text files, in m and N or in mm and kN, and return the runs read from these files."""
    length, force = (1e3, 1e-3) if in_millimetres else (1.0, 1.0)
    units = ("mm", "kN") if in_millimetres else ("m", "N")
    for run in runs:
        columns = [run.time, length * run.displacement, force_sign * force * run.force, run.command]
        header = f"time [s],displacement [{units[0]}],force [{units[1]}],current [A]"
        if run.temperature is not None:
            columns.append(run.temperature - 273.15)
            header += ",temperature [degC]"
        table = np.column_stack(columns)
        np.savetxt(folder / f"{run.name}.csv", table, "%.17g", ",", header=header, comments="")
    return read_dataset([str(folder)], flip_force=force_sign < 0.0)


def halves(run: RigRun) -> Iterator[RigRun]:
    middle = 0.5 * (run.time[0] + run.time[-1])
    for number, part in enumerate((run.between(None, middle), run.between(middle, None))):
        yield replace(part, name=f"{run.name}_{number}", source=f"{run.name}_{number}.csv")


# Changes after which the parameters are bit-identical


def test_file_order_does_not_change_parameters(case: Case, fitted: FitResult) -> None:
    """Reversing or shuffling the list of files does not change the fitted parameters."""
    runs = list(case.runs)
    np.random.default_rng(1).shuffle(runs)
    assert_equal(fitted, case.fit(Dataset(tuple(runs))))


def test_duplicate_file_does_not_change_parameters(case: Case, fitted: FitResult) -> None:
    """A second file with the same data is ignored, and a note of the fit names the repetition."""
    first = next(iter(case.runs))
    repeated = case.fit(Dataset((*case.runs, replace(first, name="copy"))))
    assert_equal(fitted, repeated)
    assert any("repeat" in note for note in repeated.result.notes)


@pytest.mark.system
def test_worker_count_does_not_change_parameters(case: Case, fitted: FitResult) -> None:
    assert_equal(fitted, case.fit(jobs=2))


def test_split_run_gives_same_parameters(case: Case, fitted: FitResult) -> None:
    """A logger may write one run into two files. The time of the second file continues the first."""
    first, *others = case.runs
    assert_equal(fitted, case.fit(Dataset((*halves(first), *others))))


# Changes that keep the information but round the data differently


def test_time_offset_hardly_changes_fitted_model(case: Case, fitted: FitResult) -> None:
    """Runs that start at 100 s instead of 0 s give the same model."""
    shifted = map_runs(case.runs, lambda run: replace(run, time=run.time + 100.0))
    assert_close(fitted, case.fit(shifted), error_percent=0.1, parameter_percent=1.0)


def test_file_units_hardly_change_fitted_model(case: Case, fitted: FitResult, tmp_path: Path) -> None:
    """Files in mm and kN give the same model as SI units."""
    runs = written(case.runs, tmp_path, in_millimetres=True)
    assert_close(fitted, case.fit(runs), error_percent=0.1, parameter_percent=1.0)


def test_flip_force_option_corrects_load_cell_sign(case: Case, fitted: FitResult, tmp_path: Path) -> None:
    """Runs with reversed force and the option ``flip_force`` give the same model as the original runs."""
    runs = written(case.runs, tmp_path, force_sign=-1.0)
    assert_close(fitted, case.fit(runs), error_percent=0.1, parameter_percent=1.0)


def test_mirrored_data_give_mirrored_model() -> None:
    """With mirrored motion and force, only the force offset of a symmetric damper changes its sign."""
    motions = {"slow": Sine(5e-3, 1.0), "fast": Sine(3e-3, 2.0), "long": Sine(15e-3, 1.0)}
    reference = REFERENCE_DAMPERS["bouc-wen"]
    damper = replace(reference, coefficients={**reference.coefficients, "offset": Constant(0.0)})
    rng = np.random.default_rng(0)
    original, mirrored = [], []
    for name, motion in motions.items():
        for current in (0.0, 0.5, 2.0):
            path = drive(motion, duration=3.0, rate_Hz=250.0, command=current)
            force = simulate(damper, path)
            force = force + 0.02 * np.std(force) * rng.standard_normal(len(force))
            displacement = np.array(path.displacement)
            run = RigRun(f"{name} {current} A", path.time, displacement, force, path.command, "A")
            original.append(run)
            mirrored.append(replace(run, displacement=-run.displacement, force=-run.force))
    case = Case(Dataset(tuple(original)), ("long*",), "bouc-wen")
    first, second = case.fit(), case.fit(Dataset(tuple(mirrored)))
    offset = first.damper.coefficients["offset"].value(1.0)
    assert second.damper.coefficients["offset"].value(1.0) == pytest.approx(-offset, abs=1.0)
    assert_close(first, second, error_percent=0.1, parameter_percent=1.0)


# Changes that add or remove little information


def test_every_second_sample_gives_similar_model(case: Case, fitted: FitResult) -> None:
    """Half the sampling rate is sufficient for training runs because the motions are slow."""
    training = {run.name for run in case.runs.split(case.hold_out)[0]}
    coarse = map_runs(case.runs, lambda run: every_second_sample(run) if run.name in training else run)
    assert_close(fitted, case.fit(coarse), error_percent=1.0, parameter_percent=5.0)


def test_run_generated_by_model_hardly_changes_model(case: Case, fitted: FitResult) -> None:
    """A run that the fitted model itself has generated adds no information to the data."""
    first = next(iter(case.runs))
    path = drive(Sine(4e-3, 1.5), duration=3.0, rate_Hz=500.0, command=float(first.command.max()) or 0.5)
    generated = generated_run(fitted.damper, path, first)
    runs = Dataset((*case.runs, generated))
    assert_close(fitted, case.fit(runs), error_percent=1.0, parameter_percent=5.0)


def every_second_sample(run: RigRun) -> RigRun:
    half = slice(None, None, 2)
    temperature = None if run.temperature is None else run.temperature[half]
    return replace(
        run,
        time=run.time[half],
        displacement=run.displacement[half],
        force=run.force[half],
        command=run.command[half],
        temperature=temperature,
    )


def generated_run(damper: Damper, path, like: RigRun) -> RigRun:
    """Return a run whose force a damper model generates, at the mean temperature of the run ``like``."""
    if like.temperature is not None:
        kelvin = np.full(len(path), float(like.temperature.mean()))
        path = replace(path, temperature=kelvin)
    return replace(
        like,
        name="generated",
        motion="",
        time=path.time,
        displacement=path.displacement,
        force=simulate(damper, path),
        command=path.command,
        temperature=path.temperature,
    )
