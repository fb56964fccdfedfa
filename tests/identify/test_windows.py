"""A quick fit uses selected sections of the runs, whose cost is close to the cost of all samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from mrdamper.data.prepare import PreparedRun, prepare_run
from mrdamper.data.records import RigRun
from mrdamper.excitation import Sine, Trajectory, drive, motion_from_text
from mrdamper.identify.settings import DEFAULT_SETTINGS
from mrdamper.identify.windows import FitWindow, representative_windows, run_windows
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import simulate
from tests.identify.reference_dampers import NO_SMOOTHING, REFERENCE_DAMPERS
from tests.support.warm import warm_damper, warm_runs

DAMPER = REFERENCE_DAMPERS["series-valve"]
GROWTH_DURATION_s = 60.0


def prepared(name: str, path: Trajectory, damper: Damper = DAMPER) -> PreparedRun:
    displacement = np.array(path.displacement)
    run = RigRun(name, path.time, displacement, simulate(damper, path), np.array(path.command), "A")
    return prepare_run(run, NO_SMOOTHING)


def chirp() -> tuple[PreparedRun, ...]:
    motion = motion_from_text("chirp:4mm:0.5-8Hz:60s")
    return (prepared("chirp", drive(motion, duration=60.0, rate_Hz=200.0, command=1.0)),)


def growing_amplitude() -> tuple[PreparedRun, ...]:
    """Return one run whose amplitude grows from 1 mm to 20 mm."""
    path = drive(Sine(1e-3, 1.0), duration=GROWTH_DURATION_s, rate_Hz=200.0, command=1.0)
    envelope = 1.0 + 19.0 * path.time / GROWTH_DURATION_s
    displacement = envelope * path.displacement
    velocity = np.gradient(displacement, path.step)
    acceleration = np.gradient(velocity, path.step)
    path = replace(path, displacement=displacement, velocity=velocity, acceleration=acceleration)
    return (prepared("growing", path),)


def grid() -> tuple[PreparedRun, ...]:
    """Return runs at several currents and temperatures."""
    return tuple(prepare_run(run, NO_SMOOTHING) for run in warm_runs(warm_damper(), seed=0))


def cost(damper: Damper, windows: Sequence[FitWindow]) -> float:
    """Return the weighted squared error [%^2] of a damper in the selected sections."""
    errors = [(simulate(damper, w.drive) - w.force)[w.start :] for w in windows]
    return float(sum(w.weight * e @ e for w, e in zip(windows, errors, strict=True)))


def wrong(damper: Damper) -> Damper:
    """Return a damper with 10 % less yield force."""
    return damper.with_parameters(
        {name: 0.9 * value for name, value in damper.parameters.items() if name.startswith("yield_force.")}
    )


@pytest.mark.parametrize("campaign", [chirp, growing_amplitude, grid])
def test_selected_run_sections_approximate_total_cost(campaign) -> None:
    """For a wrong damper, a quarter of the samples gives the cost of all samples within 10 %."""
    runs, damper = campaign(), wrong(warm_damper() if campaign is grid else DAMPER)
    every = run_windows(runs, DEFAULT_SETTINGS)
    samples = sum(len(window.force) for window in every)
    windows = representative_windows(runs, DEFAULT_SETTINGS, samples_max=samples / 4)
    assert sum(len(window.force) for window in windows) <= samples / 4
    assert np.sqrt(cost(damper, windows)) == pytest.approx(np.sqrt(cost(damper, every)), rel=0.1)


def test_selected_run_sections_ignore_run_order() -> None:
    """The order of the runs changes neither the selected sections nor their weights."""

    def content(runs: Sequence[PreparedRun]) -> list[tuple[str, float, float, float]]:
        windows = representative_windows(runs, DEFAULT_SETTINGS, samples_max=2000)
        return sorted(
            (runs[w.run].name, float(w.force[0]), float(w.force[-1]), round(w.fraction, 12)) for w in windows
        )

    runs = grid()
    assert content(runs) == content(runs[::-1])


def test_selected_run_sections_cover_all_amplitudes() -> None:
    """Every amplitude of the run is within 30 % of the amplitude of a selected section."""
    (run,) = growing_amplitude()
    windows = representative_windows([run], DEFAULT_SETTINGS, samples_max=len(run) / 3)
    selected = np.array([np.ptp(w.drive.trajectory.displacement[w.start :]) for w in windows])
    for amplitude in np.linspace(1.5e-3, 19e-3, 30):
        assert np.abs(np.log(selected / (2.0 * amplitude))).min() < np.log(1.3)


@pytest.mark.parametrize("campaign", [chirp, growing_amplitude])
def test_samples_before_run_section_restore_hysteresis(campaign) -> None:
    """The force in a section differs by less than 1 % from the simulation of the whole run."""
    (run,) = campaign()
    for window in representative_windows([run], DEFAULT_SETTINGS, samples_max=len(run) / 4):
        error = (simulate(DAMPER, window.drive) - window.force)[window.start :]
        assert np.sqrt(np.mean(error**2)) < 0.01 * np.std(run.force)
