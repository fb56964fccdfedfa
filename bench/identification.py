"""Identification: searches on one campaign, then the real runs of MRDAMPER_DATA.

Of the real runs: errors beside their bars, agreement of starts, CPU.
"""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from bench import searches
from bench.measure import Row, absent
from mrdamper.data.prepare import PreparedRun, prepare_run
from mrdamper.data.readers import read_runs
from mrdamper.identify.assess import leave_out, score_run, summary
from mrdamper.identify.problem import FitProblem, FitResult
from mrdamper.identify.search.variable_projection import fit_variable_projection
from mrdamper.identify.templates import template

__all__ = ["run"]

REAL = "the real runs"


def _fit(law: str, runs: Sequence[PreparedRun], *, starts: int, seed: int = 0) -> FitResult:
    damper, free = template(law, runs)
    return fit_variable_projection(FitProblem(damper, free, tuple(runs)), starts=starts, seed=seed)


def _prepared(folder: Path, pattern: str) -> tuple[list[PreparedRun], float]:
    """Return the runs ready, and the CPU that preparing took (reading is not counted)."""
    runs = read_runs(sorted(folder.glob(pattern)))
    begin = time.process_time()
    return [prepare_run(run) for run in runs], time.process_time() - begin


def _said(errors: dict[str, float]) -> str:
    above, worst = errors["worst_above_zero"], errors["worst"]
    return f"median {errors['median']:.2f} %, worst above 0 {above:.2f} %, worst {worst:.2f} %"


def _whole(result: FitResult, law: str, runs: Sequence[PreparedRun], prepare_s: float, bar: str) -> Row:
    errors = [score_run(result.damper, run, "training") for run in runs]
    whole = summary(replace(e, nrmse_percent=e.nrmse_whole_percent) for e in errors)
    said = f"{_said(summary(errors))}; whole run {_said(whole)}"
    return Row(
        f"{law}, {len(runs)} runs, {len(result.starts)} starts",
        result.cpu_s + prepare_s,
        accuracy=said,
        bar=bar,
    )


def run(*, full: bool = False) -> list[Row]:
    """Return the searches side by side, and fits to UTFSM and UTFPR runs where the data are there."""
    return [*searches.rows(full=full), *(replace(row, group=REAL) for row in _real_runs())]


def _real_runs() -> list[Row]:
    """Return fits to UTFSM and UTFPR runs; without the data, one row that says so."""
    named = os.environ.get("MRDAMPER_DATA", "")
    folder = Path(named) / "dev"
    if not named or not folder.is_dir():
        return [absent("fits to real runs", "MRDAMPER_DATA does not name the folder of real runs")]
    sines, prepare_s = _prepared(folder, "utfsm_sine_*.csv")
    fits = [_fit("series-valve", sines, starts=1, seed=seed) for seed in range(8)]
    best = min(fits, key=lambda fit: fit.cost_percent)
    near = sum(fit.cost_percent <= 1.001 * best.cost_percent for fit in fits)
    rows = []
    for seed, fit in enumerate(fits):
        above = 100.0 * (fit.cost_percent / best.cost_percent - 1.0)
        said = f"cost {fit.cost_percent:.4f} %, {above:.3f} % above the best"
        rows.append(
            Row(
                f"series-valve, UTFSM, one start, seed {seed}",
                fit.cpu_s + prepare_s,
                accuracy=said,
                bar="2 s, 0.1 %",
            )
        )
    rows.append(
        Row(
            "series-valve, UTFSM: starts within 0.1 % of the best",
            accuracy=f"{near} of {len(fits)}",
            bar="8 of 8",
        )
    )
    rows.append(_whole(best, "series-valve, UTFSM", sines, prepare_s, "6.5 / 8.5 / 17; whole run 7 / 9 / 18"))

    begin = time.process_time()
    left = leave_out(lambda kept: _fit("series-valve", kept, starts=2).damper, sines, "motion")
    errors = summary(e for each in left for e in each.errors)
    cpu = time.process_time() - begin
    rows.append(Row("series-valve, UTFSM, leave one motion out", cpu, accuracy=_said(errors), bar="7.5 / 12"))

    plain = _fit("bouc-wen", sines, starts=1)
    rows.append(_whole(plain, "bouc-wen, UTFSM", sines, prepare_s, "13.5; 0.5 s"))
    tables, prepare_s = _prepared(folder, "utfpr_*.csv")
    saturating = _fit("bouc-wen-saturating", tables, starts=5)
    rows.append(_whole(saturating, "bouc-wen-saturating, UTFPR", tables, prepare_s, "9 / worst 13"))
    return rows
