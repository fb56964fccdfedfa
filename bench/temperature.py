"""Temperature: errors of the laws on the virtual rig beside what was asked, the paper's way, and CPU time.

The default campaign of the rig, 20, 40, 80 and 120 degC trained; the rest is predicted. An RMSE is over the
five currents of a motion at a temperature. The figures hold for this rig, whose physics is none of the laws;
they are not those of a damper in metal.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial

import numpy as np

import mrdamper
from bench.measure import Row
from mrdamper.data.records import RigRun
from mrdamper.identify.assess import RunError
from mrdamper.identify.fit import Identification
from mrdamper.identify.search.population import fit_genetic
from mrdamper.rig.campaign import Campaign
from mrdamper.rig.measurement import measure
from mrdamper.rig.plant import PRESETS

__all__ = ["run"]

TRAINED, UNSEEN, WARMEST = (20, 40, 80, 120), (60, 100, 123), 123
MOTIONS, CHIRP = ("sine5mm1Hz", "sine3mm2Hz", "nonperiodic"), "chirp3mm"
BARS_N = {"nominal": (25.0, 35.0), "hard": (45.0, 55.0)}  # of sine5mm1Hz, of the other trained motions
PAPER_N = "the paper, on its own damper: 65.2 / 64.8 / 71.3 / 72.6 N"
GENERATIONS = 60  # of the genetic algorithm on 60 runs: a fifth of the usual 300, which take minutes
LAWS = ("bouc-wen", "bouc-wen-saturating", "double-bouc-wen", "spencer", "lugre", "series-valve")
CONTENDERS = {"nominal": LAWS, "hard": LAWS, "stiff": ("bouc-wen", "double-bouc-wen")}
ONE_START_S = {"bouc-wen": 1.0, "series-valve": 6.0}
TERMS = ("friction", "thinning")

Errors = Mapping[tuple[str, int], float]
"""RMSE [N] by motion and temperature [degC]."""


def run() -> list[Row]:
    """Return the errors on each damper by law, motion and temperature, then the timing of one start."""
    rows = []
    for preset, laws in CONTENDERS.items():
        campaign = Campaign()
        runs = [measured for measured, _ in measure(PRESETS[preset], campaign)]
        rows += _accuracy(preset, campaign, runs, laws)
    return [*rows, *_timing()]


def _accuracy(preset: str, campaign: Campaign, runs: Sequence[RigRun], laws: Sequence[str]) -> list[Row]:
    training, _ = mrdamper.Dataset(tuple(runs)).split(campaign.hold_out)
    constant = [each for each in runs if each.constant_command is not None]
    steady = [each for each in training if each.constant_command is not None]
    bars = BARS_N.get(preset)
    found: dict[str, Errors] = {}
    rows: list[Row] = []

    def told(
        title: str, fit: Callable[[], Identification], bars: tuple[float, float] | None = None, note: str = ""
    ) -> Errors:
        fitted = fit()
        errors = _by_temperature(mrdamper.predict(fitted, constant))
        rows.extend(_rows(f"{preset}, {title}", fitted, errors, bars, note))
        return errors

    usual = mrdamper.fit(training)
    for law in laws:
        mark = " (what is fitted unless told)" if law == usual.damper.law.name else ""
        found[law] = told(f"{law}{mark}", partial(mrdamper.fit, training, law), bars)
    if bars is None:
        return rows
    aware = found[usual.damper.law.name]
    cold = [each for each in steady if "_020C_" in each.name]
    blind = partial(mrdamper.fit, law=usual.damper.law.name, temperature="none", terms=TERMS)
    for title, given, times in (("identified at 20 degC alone", cold, 4.0), ("pooled", steady, 2.0)):
        errors = told(f"temperature not known, {title}", partial(blind, given))
        rows.append(_against(f"{preset}, temperature not known, {title}", errors, aware, times))
    sines = [each for each in steady if each.name.endswith(f"_{MOTIONS[0]}")]
    paper = partial(mrdamper.fit, sines, "bouc-wen", temperature="paper", terms=())
    title = f"the paper's law (bouc-wen, its forms), {MOTIONS[0]} alone"
    told(f"{title}, genetic algorithm (200 x 300)", partial(paper, method="genetic"), note=PAPER_N)
    told(f"{title}, variable projection", paper, note=PAPER_N)
    return rows


def _by_temperature(errors: Iterable[RunError]) -> Errors:
    """Return the RMSE [N] over the currents, by motion and nearest degree of the campaign."""
    squares: dict[tuple[str, int], list[float]] = {}
    for error in errors:
        assert error.temperature_degC is not None
        squares.setdefault((error.motion, round(error.temperature_degC)), []).append(error.rmse_N**2)
    return {key: float(np.sqrt(np.mean(values))) for key, values in squares.items()}


def _over(errors: Errors, motions: Iterable[str], temperatures: Iterable[int]) -> float:
    """Return the RMSE [N] over motions and temperatures, each with the same weight."""
    return float(np.sqrt(np.mean([errors[m, t] ** 2 for m in motions for t in temperatures])))


def _list(errors: Errors, motion: str, temperatures: Iterable[int]) -> str:
    return " / ".join(f"{errors[motion, t]:.1f}" for t in temperatures)


def _rows(
    title: str, fitted: Identification, errors: Errors, bars: tuple[float, float] | None, note: str
) -> Iterable[Row]:
    """Return one row per motion: trained temperatures, held-out temperatures; then the chirp."""
    for motion in MOTIONS:
        trained, worst = _over(errors, [motion], TRAINED), max(errors[motion, t] for t in UNSEEN)
        said = f"{_list(errors, motion, TRAINED)} N at {_degrees(TRAINED)}; held out "
        said += f"{_list(errors, motion, UNSEEN)} N at {_degrees(UNSEEN)}, at most {worst / trained:.2f} x"
        bar = f"{bars[motion != MOTIONS[0]]:g} N; 1.15 x" if bars is not None else ""
        if motion == MOTIONS[0]:
            bar = bar or note
        cpu = fitted.cpu_s if motion == MOTIONS[0] else None
        yield Row(f"{title}: {motion}", cpu, accuracy=said, bar=bar)
    trained = _over(errors, MOTIONS, TRAINED)
    every = sorted((*TRAINED, *UNSEEN))
    chirp = _over(errors, [CHIRP], every)
    by_temperature = {t: errors[CHIRP, t] / _over(errors, MOTIONS, [t]) for t in TRAINED}
    worst = max(by_temperature, key=lambda t: by_temperature[t])
    said = f"{chirp:.1f} N, {chirp / trained:.2f} x the {trained:.1f} N of the training; "
    said += f"{_list(errors, CHIRP, every)} N at {_degrees(every)}; against the training at the same "
    said += f"temperature at most {by_temperature[worst]:.2f} x, at {worst} degC"
    yield Row(f"{title}: held-out {CHIRP}", accuracy=said, bar="1.5 x" if bars is not None else "")


def _against(title: str, blind: Errors, aware: Errors, times: float) -> Row:
    """Return how much worse a model without temperature is, at the warmest and over all held-out ones."""
    by_motion = {m: blind[m, WARMEST] / aware[m, WARMEST] for m in MOTIONS}
    at, known = (_over(errors, MOTIONS, [WARMEST]) for errors in (blind, aware))
    least = min(by_motion, key=lambda m: by_motion[m])
    everywhere = [_over(errors, MOTIONS, (*TRAINED, *UNSEEN)) for errors in (blind, aware)]
    said = f"{WARMEST} degC: {at:.1f} N against {known:.1f} N, {at / known:.1f} x (least: {least}, "
    said += f"{by_motion[least]:.1f} x); over all temperatures {everywhere[0]:.1f} N against "
    said += f"{everywhere[1]:.1f} N, {everywhere[0] / everywhere[1]:.1f} x"
    return Row(f"{title}, against the aware model", ratio=at / known, accuracy=said, bar=f"{times:g} x")


def _degrees(temperatures: Iterable[int]) -> str:
    return f"{'/'.join(map(str, temperatures))} degC"


def _timing() -> list[Row]:
    """Return one start on 60 runs (5 x 4 x 3, 4 s at 500 Hz), and the genetic algorithm on the same."""
    campaign = Campaign(motions=MOTIONS, temperatures_degC=TRAINED, steps=None)
    runs = [measured for measured, _ in measure(PRESETS["nominal"], campaign)]
    assert len(runs) == 60
    assert all(len(each) == 2000 for each in runs)
    rows: list[Row] = []
    spent_by: dict[str, float] = {}
    for law in ("bouc-wen", "double-bouc-wen", "series-valve"):
        fits = [mrdamper.fit(runs, law, starts=1, seed=seed) for seed in range(3)]
        spent_by[law] = spent = float(np.median([fit.cpu_s for fit in fits]))
        costs = ", ".join(f"{fit.cost_percent:.3f}" for fit in fits)
        rows.append(
            Row(
                f"{law}, 60 runs, one start, preparation included, median of 3 seeds",
                spent,
                ratio=spent / spent_by["bouc-wen"],
                accuracy=f"cost {costs} %",
                bar=f"{ONE_START_S[law]:g} s" if law in ONE_START_S else "",
            )
        )
    problem = mrdamper.fit(runs, "bouc-wen").problem
    genetic = fit_genetic(problem, population=200, generations=GENERATIONS)
    rows.append(
        Row(
            f"bouc-wen, the same 60 runs, genetic algorithm (200 x {GENERATIONS}, of usual 300)",
            genetic.cpu_s,
            ratio=genetic.cpu_s / spent_by["bouc-wen"],
            accuracy=f"cost {genetic.cost_percent:.3f} %",
        )
    )
    return rows
