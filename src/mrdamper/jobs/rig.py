"""The job ``rig``: simulate a test campaign on a rig with a virtual damper.

The result has sensor signals and reference values of each run.

The reference values (noise-free force, true temperature, coil current, parameters of the damper) are used
only for validation. Identification never reads the reference values.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

from mrdamper.data.records import Dataset, RigRun
from mrdamper.jobs.options import RigOptions
from mrdamper.results import JobResult
from mrdamper.runtime.progress import Progress, ProgressUpdate, silent
from mrdamper.virtual_rig.campaign import Campaign, PlannedRun, default_campaign
from mrdamper.virtual_rig.damper import PRESETS, draw_variant
from mrdamper.virtual_rig.measurement import Truth, measure_run
from mrdamper.virtual_rig.plant import VirtualDamper

_USUAL = RigOptions()


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredRun:
    """A run of a campaign: plan, sensor signals and reference values."""

    plan: PlannedRun
    run: RigRun
    truth: Truth


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RigResult(JobResult):
    """The runs of a campaign on a virtual damper."""

    _job = "rig"
    damper: VirtualDamper
    campaign: Campaign
    seed: int
    runs: tuple[MeasuredRun, ...]
    cpu_s: float

    @property
    def dataset(self) -> Dataset:
        """Return the sensor signals of all runs, without the reference values."""
        return Dataset(tuple(each.run for each in self.runs))


def rig(
    options: RigOptions = _USUAL,
    *,
    preset: VirtualDamper = PRESETS["nominal"],
    campaign: Campaign | None = None,
    on_progress: Progress = silent,
) -> RigResult:
    """Run a campaign on a virtual damper. Equal seeds give bit-identical results.

    Parameters
    ----------
    preset : parameters of the virtual damper
    campaign : test plan; None: the default campaign of the damper

    Raises
    ------
    InputError
        If the seed is negative.
    """
    clock = time.process_time()
    chosen = preset if options.draw is None else draw_variant(preset, options.draw)
    tests = default_campaign(chosen) if campaign is None else campaign
    planned = tests.runs(chosen.name)
    runs = []
    for done, plan in enumerate(planned):
        on_progress(ProgressUpdate(done=done, total=len(planned), text=plan.name))
        runs.append(MeasuredRun(plan, *measure_run(chosen, plan, tests, seed=options.seed)))
    return RigResult(chosen, tests, options.seed, tuple(runs), time.process_time() - clock)
