"""The job ``cycles``: compute energy, forces, stiffness and temperature of every cycle of a record."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.cycles import CycleFigures, count_record
from mrdamper.data.finding import Finding, severity_rank
from mrdamper.data.proposal.recordings import RigFile
from mrdamper.jobs.options import CyclesOptions
from mrdamper.quantities import ZERO_CELSIUS_K, CommandUnit
from mrdamper.results import JobResult

_DEFAULT = CyclesOptions()


@dataclass(frozen=True, slots=True, kw_only=True)
class FigureSummary:
    """Statistics of one quantity, such as the energy, over all cycles."""

    mean: float
    min: float
    max: float
    first: float  # mean of the first ``CyclesResult.group_size`` cycles
    last: float  # mean of the last ``CyclesResult.group_size`` cycles
    trend_per_1000_cycles: float | None  # slope of the least-squares line; None if there is only one cycle


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class CyclesResult(JobResult):
    """The cycles of a record, and the findings about the record."""

    _job = "cycles"
    source: str
    understood: str  # description of the format of the file
    rows: int
    stroke_min_m: float  # Cycles with a smaller stroke are ignored.
    breaks: int  # number of gaps in the record; cycles with a gap are omitted
    run: tuple[str, ...]  # name of the run of each cycle
    cycles: CycleFigures
    command_unit: CommandUnit
    findings: tuple[Finding, ...]  # sorted, worst first

    @property
    def energy_J(self) -> float:
        """Return the total energy that all cycles dissipate."""
        return float(self.cycles.energy_J.sum())

    @property
    def columns(self) -> dict[str, FloatArray]:
        """Return one array for each value, by name: the value in every cycle, in the units of cycles.csv."""
        found = self.cycles
        columns = {
            "period_s": found.period_s,
            "amplitude_mm": 1e3 * found.amplitude_m,
            "energy_J": found.energy_J,
            "stiffness_N_per_mm": 1e-3 * found.stiffness_N_per_m,
            "highest_force_N": found.highest_force_N,
            "lowest_force_N": found.lowest_force_N,
            "temperature_degC": found.temperature_K - ZERO_CELSIUS_K,
        }
        return {name: values for name, values in columns.items() if np.isfinite(values).any()}

    @property
    def group_size(self) -> int:
        """Return the number of cycles in each group; a group is one point of a plotted curve."""
        return -(-len(self.cycles) // 2048) or 1  # max number of points of a curve on the page

    @property
    def group_number(self) -> FloatArray:
        """Return the mean cycle number of each group, counted from 1; shape (groups,)."""
        return self._groups(np.arange(1.0, len(self.cycles) + 1.0))[0]

    @property
    def groups(self) -> dict[str, tuple[FloatArray, FloatArray, FloatArray]]:
        """Return mean, min and max of each value in every group of cycles, as arrays of shape (groups,)."""
        return {name: self._groups(values) for name, values in self.columns.items()}

    @property
    def figures(self) -> dict[str, FigureSummary]:
        """Return the statistics of each value over all cycles, by name."""
        return {name: self._summary(values) for name, values in self.columns.items()}

    def _groups(self, values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        begins = np.arange(0, len(values), self.group_size)
        known = np.isfinite(values)
        with np.errstate(invalid="ignore"):
            mean = np.add.reduceat(np.where(known, values, 0.0), begins) / np.add.reduceat(
                known, begins, dtype=float
            )
        return mean, np.fmin.reduceat(values, begins), np.fmax.reduceat(values, begins)

    def _summary(self, values: FloatArray) -> FigureSummary:
        number = np.flatnonzero(np.isfinite(values)).astype(np.float64)
        known = values[np.isfinite(values)]
        away = number - number.mean()
        size = self.group_size
        return FigureSummary(
            mean=float(known.mean()),
            min=float(known.min()),
            max=float(known.max()),
            first=float(known[:size].mean()),
            last=float(known[-size:].mean()),
            trend_per_1000_cycles=1e3 * float(away @ known / (away @ away)) if len(known) > 1 else None,
        )


def cycles(record: RigFile, options: CyclesOptions = _DEFAULT) -> CyclesResult:
    """Count and evaluate the cycles of a record. Several runs in one file are joined in their order."""
    stroke_min_m = None if options.least_stroke_mm is None else 1e-3 * options.least_stroke_mm
    runs = record.recordings
    counted = [count_record(run, stroke_min_m) for run in runs]
    figures = CycleFigures.concatenate([each.figures for each in counted])
    names = [[run.name] * len(each.figures) for run, each in zip(runs, counted, strict=True)]
    breaks = sum(each.breaks for each in counted)
    stroke_min_m = min(each.stroke_min_m for each in counted)
    findings = (*record.findings, *_findings(figures, breaks, stroke_min_m))
    return CyclesResult(
        source=runs[0].source,
        understood=record.layout.in_words(),
        rows=sum(map(len, runs)),
        stroke_min_m=stroke_min_m,
        breaks=breaks,
        run=tuple(itertools.chain.from_iterable(names)),
        cycles=figures,
        command_unit=runs[0].command_unit,
        findings=tuple(sorted(findings, key=severity_rank)),
    )


def _findings(cycles: CycleFigures, breaks: int, stroke_min_m: float) -> Iterator[Finding]:
    """Generate findings about gaps of the record, a wrong sign of force, and missing cycles."""
    if breaks:
        yield Finding(
            kind="breaks",
            severity="warning",
            channel="",
            size=float(breaks),
            unit="places",
            found=f"At {breaks} places rows are missing or invalid, or time has a gap or does not increase",
            effect="The cycles at these places are left out",
            remedy="Look at the rows that the recorder wrote there",
        )
    if (energy_J := float(cycles.energy_J.sum())) < 0.0:
        yield Finding(
            kind="force_sign",
            severity="fault",
            channel="force",
            size=energy_J,
            unit="J",
            found=f"The cycles give off {-energy_J:.4g} J in all, but a damper dissipates energy",
            effect="Energies and stiffness have the wrong sign",
            remedy="Put sign = -1 at [channel.force] in the channel map",
        )
    if not len(cycles):
        yield Finding(
            kind="no_cycles",
            severity="fault",
            channel="displacement",
            found=f"No whole cycle with a stroke of more than {1e3 * stroke_min_m:.4g} mm was found",
            effect="There are no values",
            remedy="Check the displacement and its unit; --least-stroke-mm counts smaller cycles",
        )
