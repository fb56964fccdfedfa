"""The job behind ``mrdamper track``: controllers made from a card, on a damper that is not the card.

Every controller follows every target at every temperature, with two seeds of sensor noise; a row holds the
worse of the two. The damper is a preset of the virtual rig, one of the user's own (TOML), or the damper of
another card. Controllers that do not know temperature come from cards identified at one temperature or
pooled over all. Nothing is printed here.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mrdamper.control.card_plant import CardPlant
from mrdamper.control.loop import LoopRun, ReferenceTrajectory, reference_trajectory, run_loop
from mrdamper.control.optimum import search_optimum
from mrdamper.control.protocol import Controller, Plant
from mrdamper.control.scenario import SCENARIOS, Scenario, find_scenario, read_scenario
from mrdamper.control.score import AttainableRange, Score, attainable_range, score_run, worst
from mrdamper.errors import InputError
from mrdamper.files import is_there
from mrdamper.models.card import ModelCard
from mrdamper.models.card_schema import read_card
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.rig.plant import PRESETS, VirtualDamper
from mrdamper.rig.plant import Plant as RigPlant
from mrdamper.runtime.outputs import atomic_output, write_json, write_table
from mrdamper.schema import Json, did_you_mean

if TYPE_CHECKING:
    from mrdamper.control.controllers import ForceController
    from mrdamper.report.figures.track import TrackPictures

__all__ = [
    "TEMPERATURES_DEGC",
    "Row",
    "Traced",
    "TrackOptions",
    "TrackRun",
    "track",
    "track_card",
    "write_track",
]

TEMPERATURES_DEGC = (20.0, 60.0, 100.0, 123.0)

_HIGHEST_A = 2.0  # of the virtual rig's driver
_LEAST_SHARE = 0.5  # of a target, within the damper's reach
_STROKE_SLACK = 1.05  # of the card's displacement
_COPPER_PER_K = 0.00393
_DRAWN = ("recommended", "paper", "recommended-unaware", "paper-unaware")
_NEED_LAG = (
    "recommended", "recommended-causal", "recommended-adaptive", "recommended-observer", "paper-preview",
    "static-preview", "lead", "pi", "feed-forward-pi", "series-inverse",
)  # fmt: skip

Report = Callable[[int, int, str], None]
"""Told how many of how many tests are done, and which one comes now."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackOptions:
    """What ``mrdamper track`` can be told."""

    plant: str = "nominal"  # a preset, a damper's TOML or a card
    targets: tuple[str, ...] = ()  # names or scenario files; (): the three of the rig
    temperatures_degC: tuple[float, ...] = ()  # (): 20, 60, 100, 123
    controllers: tuple[str, ...] = ()  # (): all
    seed: int = 1  # and the next one
    rate_Hz: float = 1000.0
    unaware: Path | None = None  # a card identified at one temperature
    pooled: Path | None = None  # a card identified over all, without temperature
    optimum: bool = False  # search the best current, for the ratios


@dataclass(frozen=True, slots=True)
class _Damper:
    """The plant that was named, and what it is driven with."""

    name: str
    plant: Plant
    resistance_20_ohm: float | None
    highest_A: float
    stroke: tuple[float, float] | None  # [m], where it is known
    resistance_per_K: float = _COPPER_PER_K

    def resistance_ohm(self, degrees: float) -> float | None:
        cold = self.resistance_20_ohm
        return None if cold is None else cold * (1.0 + self.resistance_per_K * (degrees - 20.0))


@dataclass(frozen=True, slots=True)
class Row:
    """The worse of two seeds."""

    controller: str
    target: str
    temperature_degC: float
    score: Score


@dataclass(frozen=True, slots=True, eq=False)
class Traced:
    """What is drawn of a target: its hottest test."""

    target: str
    temperature_degC: float
    course: ReferenceTrajectory
    reach: AttainableRange
    runs: tuple[LoopRun, ...]


@dataclass(frozen=True, slots=True, eq=False)
class TrackRun:
    """What ``mrdamper track`` found, before it is put into words."""

    card: ModelCard
    plant: str
    seeds: tuple[int, int]
    rate_Hz: float
    rows: tuple[Row, ...]
    traced: tuple[Traced, ...]
    notes: tuple[str, ...]
    cpu_s: float

    @property
    def worst(self) -> list[Row]:
        """The worst of all temperatures, by controller and target; the temperature is that of rmse_N."""
        groups: dict[tuple[str, str], list[Row]] = {}
        for row in self.rows:
            groups.setdefault((row.target, row.controller), []).append(row)
        return [
            replace(max(rows, key=lambda row: row.score.rmse_N), score=worst([row.score for row in rows]))
            for rows in groups.values()
        ]


def track(
    card: Path, options: TrackOptions, *, out: Path | None = None, report: Report | None = None
) -> Json:
    """Track forces with controllers made from a card; with ``out`` write track.html, track.json, track.csv.

    Raises
    ------
    InputError
        A card that cannot control, a target that the damper cannot follow, a name that is not known.
    """
    run = track_card(card, options, report=report)
    if out is None:
        return {"card": str(card), **_answer(run)}
    with atomic_output(out) as beside:
        return write_track(run, card, beside, out)


def write_track(
    run: TrackRun, card: Path, beside: Path, out: Path, *, pictures: TrackPictures | None = None
) -> Json:
    """Write track.html, track.json and track.csv into ``beside``, of what will lie in ``out``."""
    from mrdamper.report.figures.track import TrackPictures
    from mrdamper.report.track import render_track

    files = {"report": str(out / "track.html"), "file": str(out / "track.json")}
    answer: Json = {"card": str(card), **_answer(run), **files}
    (beside / "track.html").write_text(render_track(pictures or TrackPictures(run)), encoding="utf-8")
    write_json(beside / "track.json", answer)
    write_table(beside / "track.csv", [_row(row, run.plant) for row in run.rows])
    return answer


def track_card(path: Path, options: TrackOptions, *, report: Report | None = None) -> TrackRun:
    """Run every controller on every target at every temperature."""
    clock = time.process_time()
    card = _read_card(path)
    if not (np.isfinite(options.rate_Hz) and options.rate_Hz > 0.0):
        raise InputError(f"rate is {options.rate_Hz:g} Hz; expected a positive number")
    if options.seed < 0:
        raise InputError(f"seed is {options.seed}; expected zero or more")
    seeds = (options.seed, options.seed + 1)
    damper = _find_damper(options.plant, card)
    scenarios = _scenarios(options, damper)
    for scenario in scenarios:
        _check_stroke(scenario, str(path), card.envelope.displacement)
        if damper.stroke is not None:
            _check_stroke(scenario, f"the plant {damper.name}", damper.stroke)
    controllers = _controllers(path, card, options, damper.highest_A)
    tests = _Tests(damper, seeds, 1.0 / options.rate_Hz, options.optimum)
    reaches = {(each.name, each.temperature_degC): tests.reach(each) for each in scenarios}
    rows: list[Row] = []
    traced: list[Traced] = []
    hottest = {
        each.name: each.temperature_degC for each in sorted(scenarios, key=lambda s: s.temperature_degC)
    }
    drawn = [name for name in _DRAWN if name in controllers] or list(controllers)[:3]
    for done, scenario in enumerate(scenarios):
        if report is not None:
            report(done, len(scenarios), f"{scenario.name} at {scenario.temperature_degC:g} degC")
        course, reach = reaches[scenario.name, scenario.temperature_degC]
        found, runs = tests.run(scenario, controllers, course, reach)
        rows += found
        if hottest[scenario.name] == scenario.temperature_degC:
            shown = tuple(runs[name] for name in drawn)
            traced.append(Traced(scenario.name, scenario.temperature_degC, course, reach, shown))
    return TrackRun(
        card=card,
        plant=damper.name,
        seeds=seeds,
        rate_Hz=options.rate_Hz,
        rows=tuple(sorted(rows, key=lambda row: list(hottest).index(row.target))),
        traced=tuple(traced),
        notes=_notes(card, scenarios, damper),
        cpu_s=time.process_time() - clock,
    )


class _Tests:
    """Tests on one damper: what they share."""

    def __init__(self, damper: _Damper, seeds: Sequence[int], period_s: float, optimum: bool) -> None:  # noqa: FBT001
        self._damper, self._seeds, self._period, self._optimum = damper, seeds, period_s, optimum

    def reach(self, scenario: Scenario) -> tuple[ReferenceTrajectory, AttainableRange]:
        """Return course and reach of a scenario; refuse one that the damper mostly cannot follow."""
        damper, degrees = self._damper, scenario.temperature_degC
        course = reference_trajectory(scenario, damper.plant.step_s)
        reach = attainable_range(damper.plant, course, degrees, scenario.highest_A)
        inside = reach.feasible(course.target)[course.scored_from :]
        if inside.mean() < _LEAST_SHARE:
            most = float(np.abs(course.target[course.scored_from :]).max())
            able = float(np.percentile(np.maximum(-reach.low, reach.high), 95.0))
            raise InputError(
                f"target {scenario.name!r}: feasible only {100.0 * inside.mean():.0f} % of the time on the "
                f"damper {damper.name!r} at {degrees:g} degC (wanted up to {most:.0f} N; 0 to "
                f"{scenario.highest_A:g} A give up to about {able:.0f} N, and never against the motion); "
                f"expected at least {100.0 * _LEAST_SHARE:.0f} %. Ask for another force or phase, or name "
                "another damper"
            )
        return course, reach

    def run(
        self,
        scenario: Scenario,
        controllers: Mapping[str, Controller],
        course: ReferenceTrajectory,
        reach: AttainableRange,
    ) -> tuple[list[Row], dict[str, LoopRun]]:
        """Return a row per controller, and each one's run with the first seed."""
        damper, degrees = self._damper, scenario.temperature_degC
        resistance = damper.resistance_ohm(degrees)
        rows: list[Row] = []
        best: Score | None = None
        if self._optimum:
            best = search_optimum(
                damper.plant, scenario, period_s=self._period, resistance_ohm=resistance
            ).score
            rows.append(Row("optimum", scenario.name, degrees, best))
        firsts: dict[str, LoopRun] = {}
        for name, controller in controllers.items():
            scores = []
            for seed in self._seeds:
                run = run_loop(damper.plant, controller, replace(scenario, seed=seed), course)
                firsts.setdefault(name, replace(run, controller=name))
                scores.append(score_run(run, reach, resistance_ohm=resistance, optimum=best))
            rows.append(Row(name, scenario.name, degrees, worst(scores)))
        return rows, firsts


# --------------------------------------------------------------------------------------- what is asked for


def _read_card(path: Path) -> ModelCard:
    card = read_card(path)
    if card.damper.command_unit != "A":
        raise InputError(
            f"{path}: its command is in {card.damper.command_unit}; expected amperes, which the damper to be "
            "tracked is commanded in. Identify the runs with their coil current"
        )
    return card


def _find_damper(name: str, card: ModelCard) -> _Damper:
    """Return the plant of a preset, a damper's TOML or a card."""
    if name in PRESETS or name.endswith(".toml"):
        virtual = PRESETS[name] if name in PRESETS else VirtualDamper.from_toml(name)
        highest = min(_HIGHEST_A, card.envelope.command[1])
        return _Damper(virtual.name, RigPlant(virtual), virtual.coil_ohm, highest, None, virtual.copper_per_K)
    if not name.endswith(".json") and not is_there(name):
        raise InputError(
            f"there is no plant {name!r}; {did_you_mean(name, PRESETS)} (or the path of a card, or of a "
            "virtual damper's TOML)"
        )
    other = _read_card(Path(name))
    _check_current(f"the plant {name}", other)
    highest = min(other.envelope.command[1], card.envelope.command[1])
    actuation = other.damper.actuation
    return _Damper(
        name,
        CardPlant(other.damper, highest=highest),
        None if actuation is None else actuation.resistance_20_ohm,
        highest,
        other.envelope.displacement,
    )


def _scenarios(options: TrackOptions, damper: _Damper) -> list[Scenario]:
    """Return every target at every temperature."""
    found = []
    for name in dict.fromkeys(options.targets or tuple(SCENARIOS)):
        from_file = name.endswith(".toml")
        base = read_scenario(name) if from_file else find_scenario(name)
        usual = (base.temperature_degC,) if from_file else TEMPERATURES_DEGC
        for degrees in dict.fromkeys(options.temperatures_degC or usual):
            highest = min(base.highest_A, damper.highest_A)
            found.append(replace(base, temperature_degC=float(degrees), highest_A=highest))
    names = [(each.name, each.temperature_degC) for each in found]
    if len(set(names)) < len(names):
        raise InputError("two targets have the same name; give one of the files another name")
    return found


def _check_stroke(scenario: Scenario, place: str, stroke: tuple[float, float]) -> None:
    """Refuse a motion that goes beyond what a card knows."""
    x = reference_trajectory(scenario, 1e-3).displacement
    low, high = _STROKE_SLACK * min(stroke[0], 0.0), _STROKE_SLACK * max(stroke[1], 0.0)
    if not (x.min() >= low and x.max() <= high):
        raise InputError(
            f"{place}: its data cover {1e3 * stroke[0]:.3g} to {1e3 * stroke[1]:.3g} mm, and the target "
            f"{scenario.name!r} moves over {1e3 * x.min():.3g} to {1e3 * x.max():.3g} mm; expected a motion "
            "inside. Identify runs of that stroke, or name another target"
        )


def _check_current(place: str, card: ModelCard) -> None:
    """Refuse a card whose force is the same at every current."""
    low, high = card.envelope.command
    rows = card.damper.coefficients_at(np.array([low, high]))
    if not (np.ptp(rows, axis=1) > 0.0).any():
        raise InputError(
            f"{place}: its force does not depend on the current (data from {low:g} to {high:g} A); no "
            "current can track a force. Identify runs at two or more currents"
        )


def _controllers(path: Path, card: ModelCard, options: TrackOptions, largest: float) -> dict[str, Controller]:
    """Return the controllers that are asked for, those of the cards that do not know temperature last."""
    every: dict[str, Controller] = dict(_made(path, card, options, largest))
    made_of = dict.fromkeys(every, (path, card))
    for kind, other, names in (
        ("unaware", options.unaware, ("recommended", "paper")),
        ("pooled", options.pooled, ("recommended",)),
    ):
        if other is not None:
            blind = _read_card(other)
            made = _made(other, blind, options, largest)
            every |= {f"{name}-{kind}": made[name] for name in names}
            made_of |= {f"{name}-{kind}": (other, blind) for name in names}
    for name in options.controllers:
        if name not in every:
            _check_law(path, name, card)
            kind = name.removeprefix("recommended-")
            more = f" It is made from another card: --{kind} CARD" if kind in ("unaware", "pooled") else ""
            raise InputError(f"there is no controller {name!r}; {did_you_mean(name, every)}{more}")
    chosen = {
        name: each for name, each in every.items() if name in options.controllers or not options.controllers
    }
    late: dict[Path, list[str]] = {}
    for name in chosen:
        where, model = made_of[name]
        no_actuator_lag = model.damper.actuation is None and model.damper.command_lag_s == 0.0
        if no_actuator_lag and name.removesuffix("-unaware").removesuffix("-pooled") in _NEED_LAG:
            late.setdefault(where, []).append(name)
    if late:
        where, names_of = next(iter(late.items()))
        raise InputError(
            f"{where}: has no actuation, so {', '.join(names_of)} cannot know how late the force follows the "
            "current; expected a card identified with runs whose current steps (`steps` in the campaigns of "
            "⟦mrdamper rig⟧). Add such a run, or name controllers that need none, such as ⟦--controller "
            "paper⟧"
        )
    return chosen


def _check_law(path: Path, name: str, card: ModelCard) -> None:
    from mrdamper.control.controllers import check_name

    try:
        check_name(name, card.damper.law.name)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _made(path: Path, card: ModelCard, options: TrackOptions, largest: float) -> dict[str, ForceController]:
    from mrdamper.control.controllers import controllers_for

    _check_current(str(path), card)
    try:
        return controllers_for(card, period_s=1.0 / options.rate_Hz, largest=largest)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _notes(card: ModelCard, scenarios: Sequence[Scenario], damper: _Damper) -> tuple[str, ...]:
    """Return what a reader of the figures should know."""
    notes = []
    beyond = card.envelope.temperature
    if not card.damper.temperature_dependent:
        notes.append("the card does not know temperature: all of its controllers are unaware of it")
    elif beyond is not None:
        low, high = beyond[0] - ZERO_CELSIUS_K, beyond[1] - ZERO_CELSIUS_K
        outside = sorted(
            {s.temperature_degC for s in scenarios if not low - 5.0 <= s.temperature_degC <= high + 5.0}
        )
        if outside:
            said = ", ".join(f"{degrees:g}" for degrees in outside)
            notes.append(
                f"{said} degC: beyond the card's data ({low:.0f} to {high:.0f} degC), the edge is held"
            )
    if damper.stroke is not None:
        notes.append(
            f"the damper is the card {damper.name}: what a law leaves out of a damper is left out here, too"
        )
    speeds = {s.name: float(np.abs(reference_trajectory(s, 1e-3).velocity).max()) for s in scenarios}
    known = max(map(abs, card.envelope.velocity))
    for name, speed in speeds.items():
        if speed > 1.1 * known:
            notes.append(
                f"{name}: speeds up to {1e3 * speed:.0f} mm/s; the card's data end at {1e3 * known:.0f} mm/s"
            )
    return tuple(notes)


# ------------------------------------------------------------------------------------------- in words


def _answer(run: TrackRun) -> Json:
    return {
        "rows": [_row(row, run.plant) for row in run.rows],
        "worst": [_row(row, run.plant) for row in run.worst],
        "plant": run.plant,
        "seeds": list(run.seeds),
        "rate_Hz": run.rate_Hz,
        "scored": "the worse of the seeds; all samples after the first second, at the plant's steps",
        "notes": list(run.notes),
        "cpu_s": round(run.cpu_s, 3),
    }


def _row(row: Row, plant: str) -> Json:
    return {
        "controller": row.controller,
        "target": row.target,
        "plant": plant,
        "temperature_degC": row.temperature_degC,
        **asdict(row.score),
    }
