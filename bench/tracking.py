"""Tracking on dampers that nothing was tuned on: ``python -m bench.tracking [--draws N] [--law LAW]``.

Each damper is drawn around a preset of the virtual rig, identified from its usual campaign, and followed by
the recommended controller and by a PI with a force sensor at 20, 60, 100 and 123 degC, two seeds of noise.
A figure is the worst RMS error on the feasible samples; the table has the median and the worst of the
draws. Odd seeds report; constants are chosen on the presets and on even ones.

``--faults``: what faults of the sensors add to the error of a ``nominal`` draw at 900 N, 1 Hz instead.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import mrdamper
from bench.measure import Asked, Row, asked_table
from mrdamper.control.controllers import controllers_for
from mrdamper.control.loop import reference_trajectory, run_loop
from mrdamper.control.scenario import SCENARIOS, Disturbance, Dropout, Sensing
from mrdamper.control.score import AttainableRange, attainable_range, score_run
from mrdamper.data.records import Dataset
from mrdamper.errors import InputError
from mrdamper.jobs.options import TrackOptions
from mrdamper.jobs.track import TEMPERATURES_DEGC, track
from mrdamper.models.card import ModelCard
from mrdamper.models.card_schema import read_card
from mrdamper.virtual_rig.campaign import usual_campaign
from mrdamper.virtual_rig.damper import PRESETS, VirtualDamper, draw_variant
from mrdamper.virtual_rig.measurement import measure
from mrdamper.virtual_rig.plant import Plant


@dataclass(frozen=True, slots=True)
class Bars:
    """What is asked of a family for its three targets: of the median and of the worst draw."""

    median: tuple[float, float, float]
    worst: tuple[float, float, float]
    unit: str = "N"  # or % of the target's RMS


OF_HYDRAULIC = Bars((5.0, 7.0, 7.0), (10.0, 10.0, 10.0), "%")
FAMILIES = {
    "nominal": Bars((14.0, 20.0, 22.0), (20.0, 30.0, 30.0)),
    "hard": Bars((20.0, 25.0, 28.0), (25.0, 32.0, 35.0)),
    "hydraulic-bench": OF_HYDRAULIC,
    "hydraulic-monotube": OF_HYDRAULIC,
}
AT_MOST_PI = 75.0  # % of (damper, target) at or below a PI with a force sensor
CONTROLLERS = ("recommended", "pi")


def card_of(damper: VirtualDamper, law: str | None, kept: Path | None) -> ModelCard:
    """Return the card of the damper's usual campaign; one that is kept is read."""
    path = None if kept is None else kept / f"{damper.name}-{law or 'chosen'}.json"
    if path is not None and path.is_file():
        return read_card(path)
    campaign = usual_campaign(damper)
    runs = Dataset(tuple(run for run, _ in measure(damper, campaign)))
    card: ModelCard = mrdamper.fit(runs, law, hold_out=campaign.hold_out).card()
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        card.save(path)
    return card


def errors_of(damper: VirtualDamper, card: ModelCard, unit: str) -> dict[str, list[float]]:
    """Return by controller the worst RMS feasible error of each target.

    A damper too weak when hot for what it was asked for cold is judged below that temperature, which is said.
    """
    for hot in range(len(TEMPERATURES_DEGC), 0, -1):
        warm = TEMPERATURES_DEGC[:hot]
        try:
            found = track(card, damper, TrackOptions(controllers=CONTROLLERS, temperatures_degC=warm)).worst
        except InputError as fault:
            print(f"{damper.name}: {fault}", flush=True)
        else:
            break
    errors: dict[str, list[float]] = {name: [] for name in CONTROLLERS}
    for row in found:
        value = row.score.rmse_feasible_N if unit == "N" else row.score.rmse_feasible_percent
        errors[row.controller].append(float("inf") if value is None else value)
    return errors


def judged(family: str, seeds: list[int], law: str | None, kept: Path | None) -> tuple[list[Row], int, int]:
    """Return a family's rows, how often the controller is at or below the PI, and of how many."""
    bars, ours, below = FAMILIES[family], [], 0
    for seed in seeds:
        damper = draw_variant(PRESETS[family], seed)
        card = card_of(damper, law, kept)
        found = errors_of(damper, card, bars.unit)
        ours.append(found["recommended"])
        below += sum(a <= b for a, b in zip(*found.values(), strict=True))
        said = ["/".join(f"{value:.1f}" for value in found[name]) for name in CONTROLLERS]
        print(f"{damper.name}: {card.damper.law.name}, {said[0]} {bars.unit}; PI {said[1]}", flush=True)
    rows = []
    for name, values, median, worst in zip(
        ("1 Hz", "2 Hz", "non-periodic"), zip(*ours, strict=True), bars.median, bars.worst, strict=True
    ):
        asked = (
            Asked(f"{family}, {name}: median", median, statistics.median(values), bars.unit),
            Asked(f"{family}, {name}: worst", worst, max(values), bars.unit),
        )
        rows.append(Row(f"{family}, {name}", asked=asked))
    return rows, below, 3 * len(seeds)


BUS_S = 0.02
STUCK_DEGC = 20.0
OFFSET_N = 60.0  # constant force of the damper that the card does not have


@dataclass(frozen=True, slots=True)
class FaultRow:
    """A fault of a sensor, or an unknown force, and the largest error that it may add."""

    name: str
    most_N: float | None  # largest additional error; None: printed only
    sensors: Sensing = field(default_factory=Sensing)
    stuck_s: float | None = None  # the thermometer says 20 degC from then on; 0: from the start
    offset_N: float = 0.0
    extra: Mapping[str, float] = field(default_factory=dict)  # arguments of ``controllers_for``


_LOST = tuple(Dropout("displacement", 1.07 * k, 1.07 * k + 0.1) for k in range(1, 4))
FAULTS = (
    FaultRow("displacement lost for 100 ms once a second", 40.0, Sensing(dropouts=_LOST)),
    FaultRow(
        "displacement over a bus of 50 Hz",
        15.0,
        Sensing(displacement_hold_s=BUS_S),
        extra={"displacement_period_s": BUS_S},
    ),
    FaultRow("thermometer dead in operation", 20.0, Sensing(dropouts=(Dropout("temperature", 4.0, 1e3),))),
    FaultRow("thermometer stuck at 20 degC in operation", 20.0, stuck_s=4.0),
    FaultRow("thermometer stuck at 20 degC from the start", None, stuck_s=0.0),
    FaultRow("offset of 60 N", None, offset_N=OFFSET_N),
)
FAULTY_S = 8.0  # of a run: half of it after a thermometer that gets stuck in operation


def fault_rows(seed: int, law: str | None, kept: Path | None) -> list[Row]:
    """Return what each fault adds to the worst RMS feasible error at 900 N, 1 Hz; the rest is printed."""
    damper = draw_variant(PRESETS["nominal"], seed)
    card, plant = card_of(damper, law, kept), Plant(damper)
    reaches = {}
    for degrees in TEMPERATURES_DEGC:
        scenario = replace(SCENARIOS["sine-900N-1Hz"], temperature_degC=degrees, duration_s=FAULTY_S)
        course = reference_trajectory(scenario, plant.step_s)
        reaches[degrees] = scenario, course, attainable_range(plant, course, degrees, scenario.highest_A)

    def worst(fault: FaultRow) -> float:
        made = controllers_for(card, **fault.extra)["recommended"]
        found = [0.0]
        for degrees, (scenario, course, reach) in reaches.items():
            sensors = fault.sensors
            if fault.stuck_s is not None:
                stuck = Dropout("temperature", fault.stuck_s, FAULTY_S, "shifted", STUCK_DEGC - degrees)
                sensors = replace(sensors, dropouts=(*sensors.dropouts, stuck))
            pushed = Disturbance(force_offset_N=fault.offset_N)
            run = run_loop(plant, made, replace(scenario, sensors=sensors, disturbance=pushed), course)
            within = AttainableRange(reach.low + fault.offset_N, reach.high + fault.offset_N)
            found.append(score_run(run, within).rmse_feasible_N or float("inf"))
        return max(found)

    sound = worst(FaultRow("none", 0.0))
    rows = []
    for fault in FAULTS:
        name, added = f"nominal-{seed}, {fault.name}", worst(fault) - sound
        if fault.most_N is None:
            print(f"{name}: {added:.1f} N", flush=True)
        else:
            rows.append(Row(name, asked=(Asked(f"{name}: added", fault.most_N, added, "N"),)))
    return rows


def main() -> None:
    """Print every draw's figures, and what was asked beside what was measured."""
    parser = argparse.ArgumentParser(
        prog="python -m bench.tracking", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument("--draws", type=int, default=2, help="of each family; a minute of CPU each")
    parser.add_argument("--build", action="store_true", help="even seeds, on which constants may be chosen")
    parser.add_argument("--family", action="append", choices=list(FAMILIES), help="default: all")
    parser.add_argument("--law", help="of the cards; default: the one that identification chooses")
    parser.add_argument("--cards", type=Path, help="folder in which the cards are kept, and found again")
    parser.add_argument("--faults", action="store_true", help="of the sensors, on nominal draws")
    given = parser.parse_args()
    begin = time.process_time()
    seeds = [2 * k + (0 if given.build else 1) for k in range(given.draws)]
    if given.faults:
        print(asked_table([row for seed in seeds for row in fault_rows(seed, given.law, given.cards)]))
        return
    rows, below, count = [], 0, 0
    for family in given.family or FAMILIES:
        more, met, of = judged(family, seeds, given.law, given.cards)
        rows, below, count = [*rows, *more], below + met, count + of
    share = Asked(
        "at or below a PI with a force sensor", AT_MOST_PI, 100.0 * below / count, "%", at_least=True
    )
    print(asked_table([*rows, Row("all", asked=(share,))]))
    print(f"\n{time.process_time() - begin:.0f} s of CPU")


if __name__ == "__main__":
    main()
