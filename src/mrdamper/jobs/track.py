"""The job ``track``: test controllers made from a card on a damper that differs from the card.

Every controller tracks every target force at every temperature, twice with different sensor noise. A row of
the result has the larger of the two errors. The damper is a virtual damper (preset or TOML file), or the
damper of another card. Controllers whose name ends in *unaware* ignore temperature. They are made from a card
that was identified at one temperature.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.control.card_plant import CardPlant
from mrdamper.control.controllers import NEED_LAG, check_name, controllers_for, names_for
from mrdamper.control.loop import LoopRun, ReferenceTrajectory, reference_trajectory, run_loops
from mrdamper.control.protocol import Controller, Plant
from mrdamper.control.scenario import SCENARIOS, Scenario, find_scenario, read_scenario
from mrdamper.control.score import AttainableRange, Score, attainable_range, combine_worst, score_run
from mrdamper.control.sizing import ends_of, motions_within, shift_to_temperature, size_targets
from mrdamper.errors import InputError
from mrdamper.excitation import Trajectory
from mrdamper.files import is_there
from mrdamper.jobs.options import TrackOptions
from mrdamper.models.card import ModelCard
from mrdamper.models.card_draws import draws_of, percentile_ends
from mrdamper.models.card_schema import read_card
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import open_drive, simulate
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.results import JobResult
from mrdamper.runtime.pool import Pool, cpu_seconds
from mrdamper.runtime.progress import Progress, ProgressUpdate, silent
from mrdamper.schema import unknown_name
from mrdamper.thermal.materials import COPPER_PER_K
from mrdamper.virtual_rig.campaign import default_campaign
from mrdamper.virtual_rig.damper import PRESETS, HydraulicDamper, VirtualDamper, read_damper
from mrdamper.virtual_rig.plant import Plant as RigPlant

TEMPERATURES_DEGC = (20.0, 60.0, 100.0, 123.0)

_USUAL = TrackOptions()
_REACHED_FRACTION_MIN = 0.5  # min fraction of the time in which the damper can produce the target force
_DRAWN = ("recommended", "paper", "recommended-unaware", "paper-unaware")


@dataclass(frozen=True, slots=True)
class TrackedDamper:
    """The damper on which controllers are tested: a virtual damper, or the damper of a card."""

    name: str
    source: VirtualDamper | ModelCard


def read_plant(name: str | Path) -> TrackedDamper:
    """Return the damper of a preset name, of a TOML file with a virtual damper, or of a card file.

    Raises
    ------
    InputError
        If ``name`` is neither a preset nor a readable file.
    """
    text = str(name)
    if text in PRESETS:
        return TrackedDamper(text, PRESETS[text])
    if text.endswith(".toml"):
        virtual = read_damper(text)
        return TrackedDamper(virtual.name, virtual)
    if not text.endswith(".json") and not is_there(text):
        words = f"{text!r} is neither a preset nor the path of a card or of a virtual damper's TOML"
        raise unknown_name(words, text, PRESETS)
    return TrackedDamper(text, read_card(text))


def read_targets(names: Sequence[str | Path | Scenario]) -> list[Scenario]:
    """Return the targets with given names or scenario files (TOML); ``Scenario`` objects stay unchanged.

    Raises
    ------
    InputError
        If a name is unknown or a file is not readable.
    """
    return [name if isinstance(name, Scenario) else _read_target(name) for name in names]


def _read_target(name: str | Path) -> Scenario:
    return read_scenario(name) if str(name).endswith(".toml") else find_scenario(str(name))


@dataclass(frozen=True, slots=True)
class _Damper:
    """The damper under test as a simulated plant, with its maximum current, stroke and motions."""

    name: str
    plant: Plant
    resistance_20_ohm: float | None
    highest_A: float
    stroke: tuple[float, float] | None  # range of displacement [m]; None if unknown
    resistance_per_K: float = COPPER_PER_K
    motions: tuple[str, ...] = ()  # motions within the stroke and speed of the damper
    # True: target forces are scaled to the damper, even if the damper can produce the default forces.
    sized: bool = False

    def targets(self) -> tuple[Sequence[Scenario], bool]:
        """Return the default target forces, and True if they were scaled to the damper."""
        usual = tuple(SCENARIOS.values())
        if self.motions and (self.sized or not all(map(self._follows, usual))):
            return size_targets(self.plant, self.highest_A, self.motions), True
        return usual, False

    def _follows(self, target: Scenario) -> bool:
        """Return True if the stroke and, most of the time, the force are sufficient."""
        course = reference_trajectory(target, self.plant.step_s)
        if self.stroke is not None and not _is_within(course.displacement, self.stroke):
            return False
        reach = attainable_range(self.plant, course, target.temperature_degC, self.highest_A)
        return _share_inside(course, reach) >= _REACHED_FRACTION_MIN

    def resistance_ohm(self, degrees: float) -> float | None:
        cold = self.resistance_20_ohm
        return None if cold is None else cold * (1.0 + self.resistance_per_K * (degrees - 20.0))


@dataclass(frozen=True, slots=True)
class Row:
    """Errors of a controller for one target at one temperature (worse of two runs)."""

    controller: str
    target: str
    temperature_degC: float
    score: Score


@dataclass(frozen=True, slots=True, eq=False)
class PosteriorError:
    """90 % intervals of force and tracking error due to uncertain parameters."""

    controller: str
    low_N: FloatArray  # lower bound of the force interval at each time step, shape (n,)
    high_N: FloatArray  # upper bound of the force interval, shape (n,)
    rmse_N: tuple[float, float]  # interval of the RMS error of the scored samples
    max_N: tuple[float, float]  # interval of the maximum error of the scored samples


@dataclass(frozen=True, slots=True, eq=False)
class Traced:
    """Plotted force and current versus time for one target at the highest temperature."""

    target: str
    temperature_degC: float
    course: ReferenceTrajectory
    reach: AttainableRange
    runs: tuple[LoopRun, ...]
    # One item for each controller without force sensor; empty if no posterior samples are requested.
    posterior: tuple[PosteriorError, ...] = ()


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class TrackResult(JobResult):
    """Tracking errors (``rows``) and plotted time series (``traced``) of controllers."""

    _job = "track"
    card: ModelCard
    plant: str
    seeds: tuple[int, int]
    rate_Hz: float
    rows: tuple[Row, ...]
    traced: tuple[Traced, ...]
    notes: tuple[str, ...]
    cpu_s: float

    @property
    def max_error_rows(self) -> list[Row]:
        """Return one row for each controller and target, with the maximum errors over all temperatures."""
        groups: dict[tuple[str, str], list[Row]] = {}
        for row in self.rows:
            groups.setdefault((row.target, row.controller), []).append(row)
        return [
            replace(
                max(rows, key=lambda row: row.score.rmse_N), score=combine_worst([row.score for row in rows])
            )
            for rows in groups.values()
        ]

    @property
    def targets(self) -> list[str]:
        """Return the targets in the requested order."""
        return list(dict.fromkeys(row.target for row in self.rows))


def track(
    card: ModelCard,
    plant: TrackedDamper | VirtualDamper | ModelCard,
    options: TrackOptions = _USUAL,
    *,
    targets: Sequence[Scenario] | None = None,
    unaware: ModelCard | None = None,
    on_progress: Progress = silent,
) -> TrackResult:
    """Test every controller with every target force at every temperature.

    Parameters
    ----------
    plant : damper on which the controllers are tested
    targets : target forces with their motions; None: default targets, whose forces are adapted to
        the damper if necessary
    unaware : second card, identified at one temperature. If given, controllers made from ``unaware`` are also
        tested, with the names recommended-unaware and paper-unaware

    Raises
    ------
    InputError
        If the card has no controller, the damper cannot follow a target, a name is unknown, or requested
        posterior samples are missing.
    """
    clock = cpu_seconds()
    posterior = draws_of(card, options.posterior)
    _check_unit("card", card)
    _check_current("card", card)
    damper = _damper_of(plant, card)
    wanted, sized = (targets, False) if targets else damper.targets()
    scenarios = _scenarios(wanted, options, damper, usual=not targets, sized=sized)
    for scenario in scenarios:
        _check_stroke(scenario, "card", card.envelope.displacement)
        if damper.stroke is not None:
            _check_stroke(scenario, f"the plant {damper.name}", damper.stroke)
    controllers = _controllers(card, unaware, options, damper.highest_A)
    seeds = (options.seed, options.seed + 1)
    tests = _Tests(damper, seeds)
    scenarios, beyond = tests.possible_scenarios(scenarios) if sized else (scenarios, [])
    rows, traced = _run_all(tests, scenarios, controllers, posterior, Pool(options.jobs), on_progress)
    return TrackResult(
        card=card,
        plant=damper.name,
        seeds=seeds,
        rate_Hz=options.rate_Hz,
        rows=tuple(rows),
        traced=tuple(traced),
        notes=(
            *_another_damper(card, damper, scenarios[0]),
            *_notes(card, scenarios, damper),
            *beyond,
        ),
        cpu_s=cpu_seconds() - clock,
    )


def _run_all(
    tests: _Tests,
    scenarios: Sequence[Scenario],
    controllers: Mapping[str, Controller],
    posterior: Sequence[Damper],
    pool: Pool,
    on_progress: Progress,
) -> tuple[list[Row], list[Traced]]:
    """Simulate all scenarios; return all errors, and the time series that are plotted."""
    reaches = {(each.name, each.temperature_degC): tests.reach(each) for each in scenarios}
    rows: list[Row] = []
    traced: list[Traced] = []
    hottest = {
        each.name: each.temperature_degC for each in sorted(scenarios, key=lambda s: s.temperature_degC)
    }
    drawn = [name for name in _DRAWN if name in controllers] or list(controllers)[:3]

    def run(scenario: Scenario) -> tuple[list[Row], Traced | None]:
        course, reach = reaches[scenario.name, scenario.temperature_degC]
        scored, runs = tests.run(scenario, controllers, course, reach)
        if hottest[scenario.name] != scenario.temperature_degC:
            return scored, None
        shown = tuple(runs[name] for name in drawn)
        blind = [each for name, each in zip(drawn, shown, strict=True) if not controllers[name].needs_force]
        errors = tuple(_posterior_error(each, posterior) for each in blind if posterior)
        return scored, Traced(scenario.name, scenario.temperature_degC, course, reach, shown, errors)

    done = pool.map(run, scenarios)
    for place, scenario in enumerate(scenarios):
        text = f"{scenario.name} at {scenario.temperature_degC:g} degC"
        on_progress(ProgressUpdate(done=place, total=len(scenarios), text=text))
        found, hot = next(done)
        rows += found
        if hot is not None:
            traced.append(hot)
    return sorted(rows, key=lambda row: list(hottest).index(row.target)), traced


def _posterior_error(run: LoopRun, dampers: Sequence[Damper]) -> PosteriorError:
    """Simulate a run with each posterior sample in ``dampers``; return 90 % intervals.

    The controller must use no force sensor. Its currents then do not depend on the damper and are not
    computed again.
    """
    course, scenario = run.course, run.scenario
    drive = open_drive(_path(course, np.clip(run.current, 0.0, scenario.highest_A), scenario))
    gain = scenario.disturbance.force_gain
    forces = np.stack([gain * simulate(each, drive) for each in dampers])
    missed = np.abs(forces - course.target)[:, course.scored_from :]
    ends = percentile_ends(np.stack([np.sqrt(np.mean(missed**2, axis=1)), missed.max(axis=1)], axis=1))
    (rmse_low, max_low), (rmse_high, max_high) = (each.tolist() for each in ends)
    low, high = percentile_ends(forces)
    return PosteriorError(run.controller, low, high, (rmse_low, rmse_high), (max_low, max_high))


def _path(course: ReferenceTrajectory, current: FloatArray, scenario: Scenario) -> Trajectory:
    """Return a trajectory with ``current`` [A] and the motion of a scenario."""
    return Trajectory(
        course.step_s,
        course.displacement,
        course.velocity,
        np.gradient(course.velocity, course.step_s),
        current,
        temperature=np.full(len(course), scenario.temperature_degC + ZERO_CELSIUS_K),
    )


class _Tests:
    """Tests of controllers on one damper; caches data that several tests use."""

    def __init__(self, damper: _Damper, seeds: Sequence[int]) -> None:
        self._damper, self._seeds = damper, seeds
        self._courses: dict[Scenario, ReferenceTrajectory] = {}
        self._reaches: dict[Scenario, AttainableRange] = {}

    def reach(self, scenario: Scenario) -> tuple[ReferenceTrajectory, AttainableRange]:
        """Return the reference trajectory and the range of forces of the damper.

        Raise InputError if the target force is outside this range most of the time.
        """
        damper, degrees = self._damper, scenario.temperature_degC
        like = replace(scenario, temperature_degC=0.0)  # The motion is the same at all temperatures.
        if like not in self._courses:
            self._courses[like] = reference_trajectory(scenario, damper.plant.step_s)
        course = self._courses[like]
        if scenario not in self._reaches:
            self._reaches[scenario] = attainable_range(damper.plant, course, degrees, scenario.highest_A)
        reach = self._reaches[scenario]
        inside = _share_inside(course, reach)
        if inside < _REACHED_FRACTION_MIN:
            most = float(np.abs(course.target[course.scored_from :]).max())
            able = float(np.percentile(np.maximum(-reach.low, reach.high), 95.0))
            raise InputError(
                f"feasible only {100.0 * inside:.0f} % of the time on the damper {damper.name!r} at "
                f"{degrees:g} degC (wanted up to {most:.0f} N; 0 to {scenario.highest_A:g} A give up to "
                f"about {able:.0f} N, and never against the motion)",
                place=f"target {scenario.name!r}",
                expected=f"at least {100.0 * _REACHED_FRACTION_MIN:.0f} %",
                remedy="Ask for another force or phase, or name another damper",
            )
        return course, reach

    def possible_scenarios(self, scenarios: Sequence[Scenario]) -> tuple[list[Scenario], list[str]]:
        """Return scenarios with a possible target force, and notes about other targets.

        Raise InputError if there is no such scenario. The function is used only for default targets. A target
        that the user requested is never omitted.
        """
        kept: list[Scenario] = []
        refused: dict[str, InputError] = {}  # error at the first temperature with insufficient force
        also: dict[str, list[str]] = {}  # further temperatures with insufficient force
        for each in scenarios:
            try:
                self.reach(each)
            except InputError as error:
                if each.name in refused:
                    also[each.name].append(f"{each.temperature_degC:g}")
                else:
                    refused[each.name], also[each.name] = error, []
            else:
                kept.append(each)
        if not kept:
            raise next(iter(refused.values()))
        reasons = [
            f"{error}; nor at {', '.join(also[name])} degC" if also[name] else str(error)
            for name, error in refused.items()
        ]
        return kept, [f"left out: {reason}" for reason in reasons]

    def run(
        self,
        scenario: Scenario,
        controllers: Mapping[str, Controller],
        course: ReferenceTrajectory,
        reach: AttainableRange,
    ) -> tuple[list[Row], dict[str, LoopRun]]:
        """Return one row for each controller, and the run of each controller with the first seed."""
        damper, degrees = self._damper, scenario.temperature_degC
        resistance = damper.resistance_ohm(degrees)
        seeded = [replace(scenario, seed=seed) for seed in self._seeds]
        found = run_loops(damper.plant, list(controllers.values()), seeded, course)
        runs = {
            name: [replace(run, controller=name) for run in of_seeds]
            for name, of_seeds in zip(controllers, found, strict=True)
        }
        rows = []
        for name, of_seeds in runs.items():
            scores = [score_run(run, reach, resistance_ohm=resistance) for run in of_seeds]
            rows.append(Row(name, scenario.name, degrees, combine_worst(scores)))
        return rows, {name: of_seeds[0] for name, of_seeds in runs.items()}


# --------------------------------------------------------------------------------------- requests


def _check_unit(place: str, card: ModelCard) -> None:
    if card.damper.command_unit != "A":
        raise InputError(
            f"its command is in {card.damper.command_unit}",
            place=place,
            expected="amperes, which the damper to be tracked is commanded in",
            remedy="Fit the runs with their coil current",
        )


def _damper_of(given: TrackedDamper | VirtualDamper | ModelCard, card: ModelCard) -> _Damper:
    """Return the simulation of a virtual damper or of the damper of a card, with its limits."""
    if isinstance(given, VirtualDamper):
        given = TrackedDamper(given.name, given)
    elif isinstance(given, ModelCard):
        given = TrackedDamper(given.title or given.damper.law.name, given)
    name, source = given.name, given.source
    if isinstance(source, VirtualDamper):
        highest = min(source.highest_A, card.envelope.command[1])
        sized = isinstance(source, HydraulicDamper)
        return _Damper(
            name,
            RigPlant(source),
            source.coil_ohm,
            highest,
            None,
            source.copper_per_K,
            default_campaign(source).motions,
            sized,
        )
    _check_unit(name, source)
    _check_current(f"the plant {name}", source)
    highest = min(source.envelope.command[1], card.envelope.command[1])
    actuation = source.damper.actuation
    return _Damper(
        name,
        CardPlant(source.damper, highest=highest),
        None if actuation is None else actuation.resistance_20_ohm,
        highest,
        source.envelope.displacement,
        motions=motions_within(source.envelope.displacement, source.envelope.velocity),
    )


def _scenarios(
    targets: Sequence[Scenario], options: TrackOptions, damper: _Damper, *, usual: bool, sized: bool
) -> list[Scenario]:
    """Return one scenario for every target and temperature.

    ``usual`` is True for default targets, which are tested at default temperatures. ``sized`` is True if the
    target forces were scaled to the damper. The forces are then also adapted to each temperature.
    """
    found: list[Scenario] = []
    for base in targets:
        warm = TEMPERATURES_DEGC if usual or SCENARIOS.get(base.name) is base else (base.temperature_degC,)
        for degrees in dict.fromkeys(options.temperatures_degC or warm):
            limited = replace(base, highest_A=min(base.highest_A, damper.highest_A))
            if sized:
                found.append(shift_to_temperature(damper.plant, limited, float(degrees)))
            else:
                found.append(replace(limited, temperature_degC=float(degrees)))
    unique = list(dict.fromkeys(found))
    names = [(each.name, each.temperature_degC) for each in unique]
    if len(set(names)) < len(names):
        raise InputError("two targets have the same name", remedy="give one of the files another name")
    return unique


def _is_within(displacement: FloatArray, stroke: tuple[float, float]) -> bool:
    stroke_ratio_max = 1.05  # max displacement of a target, divided by the displacement of the card
    low, high = stroke_ratio_max * min(stroke[0], 0.0), stroke_ratio_max * max(stroke[1], 0.0)
    return bool(displacement.min() >= low and displacement.max() <= high)


def _share_inside(course: ReferenceTrajectory, reach: AttainableRange) -> float:
    """Return the fraction of the scored time in which the target force is attainable."""
    return float(reach.feasible(course.target)[course.scored_from :].mean())


def _check_stroke(scenario: Scenario, place: str, stroke: tuple[float, float]) -> None:
    """Raise InputError if the motion of a scenario exceeds the range of displacement ``stroke`` [m]."""
    x = reference_trajectory(scenario, 1e-3).displacement
    if not _is_within(x, stroke):
        raise InputError(
            f"its data cover {1e3 * stroke[0]:.3g} to {1e3 * stroke[1]:.3g} mm, and the target "
            f"{scenario.name!r} moves over {1e3 * x.min():.3g} to {1e3 * x.max():.3g} mm",
            place=place,
            expected="a motion inside",
            remedy="Fit runs of that stroke, or name another target",
        )


def _check_current(place: str, card: ModelCard) -> None:
    """Raise InputError if the force of a card does not depend on the current."""
    low, high = card.envelope.command
    rows = card.damper.coefficients_at(np.array([low, high]))
    if not (np.ptp(rows, axis=1) > 0.0).any():
        raise InputError(
            f"its force does not depend on the current (data from {low:g} to {high:g} A); no current can "
            "track a force",
            place=place,
            remedy="Fit runs at two or more currents",
        )


def _controllers(
    card: ModelCard, unaware: ModelCard | None, options: TrackOptions, largest: float
) -> dict[str, Controller]:
    """Return the requested controllers by name; controllers named *unaware* are last."""
    every: dict[str, Controller] = dict(_build("card", card, options, largest))
    cards = dict.fromkeys(every, ("card", card))
    if unaware is not None:
        _check_unit("unaware", unaware)
        _check_current("unaware", unaware)
        made = _build("unaware", unaware, options, largest)
        for name in ("recommended", "paper"):
            if name in made:
                every[f"{name}-unaware"] = made[name]
                cards[f"{name}-unaware"] = ("unaware", unaware)
    for name in options.controllers:
        if name not in every:
            raise _no_controller(name, card, every)
    chosen = {
        name: each for name, each in every.items() if name in options.controllers or not options.controllers
    }
    _check_lag({name: cards[name] for name in chosen})
    return chosen


def _no_controller(name: str, card: ModelCard, every: Mapping[str, Controller]) -> InputError:
    """Return the error for a controller that is unknown or unavailable for the card."""
    try:
        check_name(name, card.damper.law.name)
    except InputError as error:
        return error.prepend_place("card")
    return unknown_name(f"there is no controller {name!r}", name, every)


def _check_lag(cards: Mapping[str, tuple[str, ModelCard]]) -> None:
    """Raise InputError if a controller needs an actuation lag that its card lacks."""
    late: dict[str, list[str]] = {}
    for name, (place, card) in cards.items():
        no_actuator_lag = card.damper.actuation is None and card.damper.command_lag_s == 0.0
        if no_actuator_lag and name.removesuffix("-unaware") in NEED_LAG:
            late.setdefault(place, []).append(name)
    for place, names in late.items():
        usable = names_for(cards[names[0]][1].damper.law.name, has_lag=False)[0]
        raise InputError(
            f"has no actuation, so {', '.join(names)} cannot know how late the force follows the current",
            place=place,
            expected="a card identified with runs whose current steps (`steps` in the campaigns of "
            "mrdamper rig)",
            remedy=f"Add such a run, or name controllers that need none, such as --controller {usable}",
        )


def _build(place: str, card: ModelCard, options: TrackOptions, largest: float) -> Mapping[str, Controller]:
    try:
        return controllers_for(card, period_s=1.0 / options.rate_Hz, largest=largest)
    except InputError as error:
        raise error.prepend_place(place) from error


def _another_damper(card: ModelCard, damper: _Damper, scenario: Scenario) -> list[str]:
    """Return a note if card and damper have very different forces at the largest current."""
    force_ratio_max = 1.5  # A larger ratio of forces, or its inverse, indicates the card of another damper.
    course = reference_trajectory(scenario, damper.plant.step_s)
    degrees, largest = scenario.temperature_degC, scenario.highest_A
    plant = damper.plant.copy().advance_many(course.displacement, course.velocity, largest, degrees)
    own = simulate(card.damper, open_drive(_path(course, np.full(len(course), largest), scenario)))
    sizes = [0.5 * float(np.subtract(*ends_of(force[course.scored_from :])[::-1])) for force in (own, plant)]
    if max(sizes) < force_ratio_max * min(sizes):
        return []
    return [
        f"the card gives {sizes[0]:.0f} N at {largest:g} A along {scenario.name} and the damper "
        f"{damper.name} {sizes[1]:.0f} N: the card is of another damper, and these errors say nothing of it. "
        "Name its own by --plant FILE, or the card itself"
    ]


def _notes(card: ModelCard, scenarios: Sequence[Scenario], damper: _Damper) -> tuple[str, ...]:
    """Return notes about extrapolated temperatures and speeds and ignored effects."""
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
                f"the temperature is {said} degC; the card was identified from {low:.0f} to {high:.0f} degC "
                "and uses its values at the limit"
            )
    if damper.stroke is not None:
        notes.append(
            f"the damper is the card {damper.name}: what a law leaves out of a damper is left out here, too"
        )
    moved = {s.name: s for s in scenarios}  # The motion of a target is the same at all temperatures.
    speeds = {name: float(np.abs(reference_trajectory(s, 1e-3).velocity).max()) for name, s in moved.items()}
    known = max(map(abs, card.envelope.velocity))
    for name, speed in speeds.items():
        if speed > 1.1 * known:
            notes.append(
                f"the velocity of {name} reaches {1e3 * speed:.0f} mm/s; the card was identified up to "
                f"{1e3 * known:.0f} mm/s"
            )
    return tuple(notes)
