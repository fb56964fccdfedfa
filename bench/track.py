"""Force tracking on randomised dampers: ``python -m bench.track [--draws N] [--law LAW]``.

Each damper is a preset of the virtual rig with randomised parameters and is identified from its default
campaign. Two controllers track three target forces at 20, 60, 100 and 123 degC with two seeds of noise: the
recommended controller, and a PI controller with a force sensor. The error of a target is the largest RMS
error on samples whose target force the damper can produce. The table has the median and the largest error of
the dampers. Odd seeds are for reports, even seeds for development.
"""

from __future__ import annotations

import argparse
import statistics
import time
from dataclasses import dataclass
from pathlib import Path

import mrdamper
from bench.measure import Limit, Row, limit_table
from mrdamper.data.records import Dataset
from mrdamper.errors import InputError
from mrdamper.jobs.options import TrackOptions
from mrdamper.jobs.track import TEMPERATURES_DEGC, track
from mrdamper.models.card import ModelCard
from mrdamper.models.card_schema import read_card
from mrdamper.virtual_rig.campaign import default_campaign
from mrdamper.virtual_rig.damper import PRESETS, VirtualDamper, draw_variant
from mrdamper.virtual_rig.measurement import measure


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of the median and of the largest error of a damper family, for each of three targets."""

    median: tuple[float, float, float]
    worst: tuple[float, float, float]
    unit: str = "N"  # N, or % of the RMS target force


HYDRAULIC_LIMITS = Limits((5.0, 7.0, 7.0), (10.0, 10.0, 10.0), "%")
FAMILIES = {
    "nominal": Limits((14.0, 20.0, 22.0), (20.0, 30.0, 30.0)),
    "hard": Limits((20.0, 25.0, 28.0), (25.0, 32.0, 35.0)),
    "hydraulic-bench": HYDRAULIC_LIMITS,
    "hydraulic-monotube": HYDRAULIC_LIMITS,
}
# Required percentage of the (damper, target) pairs for which the error is at most the error of the PI
# controller.
BETTER_THAN_PI_MIN_PERCENT = 75.0
CONTROLLERS = ("recommended", "pi")


def card_of(damper: VirtualDamper, law: str | None, folder: Path | None) -> ModelCard:
    """Return the card from the default campaign of a damper. If the folder has this card, read it."""
    path = None if folder is None else folder / f"{damper.name}-{law or 'chosen'}.json"
    if path is not None and path.is_file():
        return read_card(path)
    campaign = default_campaign(damper)
    runs = Dataset(tuple(run for run, _ in measure(damper, campaign)))
    card: ModelCard = mrdamper.fit(runs, law, hold_out=campaign.hold_out).card()
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        card.save(path)
    return card


def errors_of(damper: VirtualDamper, card: ModelCard, unit: str) -> dict[str, list[float]]:
    """Return the largest RMS error of each controller for each target force.

    If a hot damper is too weak for a target, only lower temperatures are tested, and a message is printed.
    """
    for count in range(len(TEMPERATURES_DEGC), 0, -1):
        warm = TEMPERATURES_DEGC[:count]
        try:
            rows = track(
                card, damper, TrackOptions(controllers=CONTROLLERS, temperatures_degC=warm)
            ).max_error_rows
        except InputError as fault:
            print(f"{damper.name}: {fault}", flush=True)
        else:
            break
    errors: dict[str, list[float]] = {name: [] for name in CONTROLLERS}
    for row in rows:
        value = row.score.rmse_feasible_N if unit == "N" else row.score.rmse_feasible_percent
        errors[row.controller].append(float("inf") if value is None else value)
    return errors


def track_family(
    family: str, seeds: list[int], law: str | None, folder: Path | None
) -> tuple[list[Row], int, int]:
    """Return table rows, number of errors not above the PI's, number of all errors."""
    bounds, ours, below = FAMILIES[family], [], 0
    for seed in seeds:
        damper = draw_variant(PRESETS[family], seed)
        card = card_of(damper, law, folder)
        errors = errors_of(damper, card, bounds.unit)
        ours.append(errors["recommended"])
        below += sum(a <= b for a, b in zip(*errors.values(), strict=True))
        texts = ["/".join(f"{value:.1f}" for value in errors[name]) for name in CONTROLLERS]
        print(f"{damper.name}: {card.damper.law.name}, {texts[0]} {bounds.unit}; PI {texts[1]}", flush=True)
    rows = []
    for name, values, median, worst in zip(
        ("1 Hz", "2 Hz", "non-periodic"), zip(*ours, strict=True), bounds.median, bounds.worst, strict=True
    ):
        limits = (
            Limit(f"{family}, {name}: median", median, statistics.median(values), bounds.unit),
            Limit(f"{family}, {name}: worst", worst, max(values), bounds.unit),
        )
        rows.append(Row(f"{family}, {name}", limits=limits))
    return rows, below, 3 * len(seeds)


def main() -> None:
    """Print the errors of each damper, then the table of limits."""
    parser = argparse.ArgumentParser(
        prog="python -m bench.track", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument(
        "--draws", type=int, default=2, help="dampers of each family; one takes a minute of CPU"
    )
    parser.add_argument("--build", action="store_true", help="even seeds, for development")
    parser.add_argument("--family", action="append", choices=list(FAMILIES), help="default: all")
    parser.add_argument("--law", help="hysteresis model of the cards (default: selected)")
    parser.add_argument("--cards", type=Path, help="folder that keeps the cards")
    arguments = parser.parse_args()
    begin = time.process_time()
    seeds = [2 * k + (0 if arguments.build else 1) for k in range(arguments.draws)]
    rows, below, count = [], 0, 0
    for family in arguments.family or FAMILIES:
        family_rows, family_below, family_count = track_family(family, seeds, arguments.law, arguments.cards)
        rows, below, count = [*rows, *family_rows], below + family_below, count + family_count
    percent = 100.0 * below / count
    name = "at or below a PI with a force sensor"
    limit = Limit(name, BETTER_THAN_PI_MIN_PERCENT, percent, "%", is_minimum=True)
    print(limit_table([*rows, Row("all", limits=(limit,))]))
    print(f"\n{time.process_time() - begin:.0f} s of CPU")


if __name__ == "__main__":
    main()
