"""Files that continue the record of another file are joined to one run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mrdamper.data.continuation import join_continuations
from mrdamper.data.records import CHANNELS, Dataset, RigRun


def sine_run(
    name: str = "run", *, amplitude_m: float = 5e-3, start_s: float = 0.0, current_A: float = 1.0
) -> RigRun:
    time = start_s + np.arange(1000) / 500.0
    displacement = amplitude_m * np.sin(2.0 * np.pi * 1.5 * time)
    force = 300.0 * np.sign(np.cos(2.0 * np.pi * 1.5 * time))
    return RigRun(
        name, time, displacement, force, np.full(1000, current_A), "A", temperature=np.full(1000, 293.15)
    )


def parts(run: RigRun, *, shared_sample: bool = False) -> list[RigRun]:
    """Return three parts of a run, as a logger divides them. Neighbouring parts may share a sample."""
    edges = [0, 300, 620, len(run)]
    cut = []
    for number in range(3):
        kept = slice(edges[number] - (shared_sample and number > 0), edges[number + 1])
        columns = {name: getattr(run, name)[kept] for name in CHANNELS if getattr(run, name) is not None}
        cut.append(replace(run, name=f"{run.name}_{number}", source=f"{run.name}_{number}.csv", **columns))
    return cut


@pytest.mark.parametrize("shared_sample", [False, True])
def test_joined_parts_equal_original_run(shared_sample: bool):
    """Three parts in any order are joined to the samples of the original. Other runs are unchanged."""
    run, other = sine_run(), sine_run("other", amplitude_m=1e-2, start_s=0.5)
    first, second, third = parts(run, shared_sample=shared_sample)
    joined, continued = join_continuations(Dataset((third, other, first, second)))
    assert joined.names == ("other", "run_0")
    assert set(continued) == {"run_1", "run_2"}
    for name in ("time", "displacement", "force", "command", "temperature"):
        np.testing.assert_array_equal(getattr(joined.runs[1], name), getattr(run, name))


@pytest.mark.parametrize(
    "change",
    [
        lambda run: replace(run, time=run.time - run.time[0]),
        lambda run: replace(run, time=run.time + 1.0),
        lambda run: replace(run, command=run.command + 0.2),
        lambda run: replace(run, displacement=0.4 * run.displacement),
        lambda run: replace(run, displacement=run.displacement + 2e-3),
        lambda run: replace(run, temperature=run.temperature + 5.0),
        lambda run: replace(run, source="run_0.csv"),
    ],
    ids=["clock from zero", "gap", "current", "amplitude", "jump", "temperature", "same file"],
)
def test_runs_of_different_tests_stay_separate(change):
    """A run that does not continue the time, current, motion or temperature belongs to a different test."""
    first, second, _ = parts(sine_run())
    joined, continued = join_continuations(Dataset((first, change(second))))
    assert continued == ()
    assert joined.names == ("run_0", "run_1")
