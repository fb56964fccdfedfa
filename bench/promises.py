"""Promises of cards beside what unseen motions give: coverage of the band, expected error, standard errors.

Each motion is held out in turn; a card is made of the others and judged on it. Standard errors are compared
between cards of disjoint sets of motions. Real runs from a folder, and drawn virtual dampers: even draws were
used to choose the band's constants, odd ones are blind. With ``--steps`` the force's times to 63 % of a
step of the current, mean over the campaign's kinds of step, beside the plant's for the same steps.

    python -m bench.promises --preset nominal --draws 1 3 5
    python -m bench.promises --preset hard --draws 0 1 3 --steps
    python -m bench.promises --runs data/dev/utfsm_sine_*.csv
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.prepare import Preparation, PreparedRun
from mrdamper.data.readers import read_runs
from mrdamper.data.records import RigRun
from mrdamper.excitation import motion_from_text
from mrdamper.identify.actuation.step_responses import crossing_time
from mrdamper.identify.evaluate import prepare_all
from mrdamper.identify.fit import Identification, fit
from mrdamper.identify.motions import folds_of, motion_groups
from mrdamper.identify.scores import score_run
from mrdamper.virtual_rig.campaign import Campaign, usual_campaign
from mrdamper.virtual_rig.damper import VirtualDamper, draw_variant, find_preset
from mrdamper.virtual_rig.measurement import measure
from mrdamper.virtual_rig.plant import STEP_S, Plant

_MOTIONS = ("sine:8mm:0.5Hz", "sine:4mm:1.5Hz")  # beside the usual ones
_TEMPERATURES_degC = (20.0, 70.0, 120.0)


@dataclass(frozen=True)
class Promise:
    """What cards made without one motion promised of it, and what it gave."""

    promised_percent: float
    found_percent: tuple[float, ...]
    covered_percent: tuple[float, ...]


def held_out_motions(runs: Sequence[RigRun], *, groups: bool) -> list[Promise]:
    """Return the promise and what was found, for each motion (or fold of motions) held out."""
    prepared = prepare_all(runs, Preparation())
    raw = {run.name: run for run in runs}
    apart: Iterable[Sequence[int]] = (
        motion_groups(prepared) if groups else [fold.runs for fold in folds_of(prepared)]
    )
    found = []
    for left in apart:
        kept = [raw[run.name] for k, run in enumerate(prepared) if k not in set(left)]
        fitted = fit(kept, starts=1)
        assert fitted.force_band is not None
        band = fitted.force_band
        errors = [score_run(fitted.damper, prepared[k], band=band) for k in left]
        inside = tuple(error.in_band_percent or 0.0 for error in errors)
        found.append(Promise(band.expected_nrmse_percent, tuple(e.nrmse_percent for e in errors), inside))
    return found


def disjoint_z(runs: Sequence[RigRun]) -> float:
    """Return the rms difference of parameters between cards of two halves of the motions, in errors."""
    prepared: tuple[PreparedRun, ...] = prepare_all(runs, Preparation())
    raw, groups = {run.name: run for run in runs}, motion_groups(prepared)
    sides: list[Identification] = []
    for half in (groups[::2], groups[1::2]):
        sides.append(fit([raw[prepared[k].name] for group in half for k in group], starts=1))
    one, other = ({e.name: e for e in side.estimates} for side in sides)
    off = [
        (one[name].value - other[name].value) / np.hypot(one[name].standard_error, other[name].standard_error)
        for name in one.keys() & other.keys()
    ]
    known = np.array([z for z in off if np.isfinite(z)])
    return float(np.sqrt(np.mean(known**2)))


def drawn(preset: str, draw: int) -> list[RigRun]:
    """Return the runs at constant current of a drawn damper (0: the preset), on five or six motions."""
    usual = usual_campaign(damper := _damper(preset, draw))
    motions = (*usual.motions, *(() if "monotube" in preset else _MOTIONS))
    small = replace(_smaller(usual), motions=motions, steps=None, random=None)
    return [run for run, _ in measure(damper, small, seed=draw)]


def _damper(preset: str, draw: int) -> VirtualDamper:
    return draw_variant(find_preset(preset), draw) if draw else find_preset(preset)


def _smaller(usual: Campaign) -> Campaign:
    """Return a campaign on every other current and three temperatures, in runs of 3 s."""
    return replace(
        usual,
        currents_A=usual.currents_A[::2],
        temperatures_degC=_TEMPERATURES_degC,
        held_out_temperatures_degC=(),
        held_out_motions=(),
        duration_s=3.0,
    )


def plant_t63_s(damper: VirtualDamper, levels: Sequence[float], speed: float, degrees: float) -> float:
    """Return the plant's time [s] from the last step of a command to 63 % of the way of the force.

    That is from the force that it would have without the step to the one that it has where the step is long
    ago: the iron remembers the ``levels`` that the command has been at.
    """
    count, at, held = 4000, 2000, 5000
    x = speed * STEP_S * (np.arange(count) - at)

    def force(known: Sequence[float], current: FloatArray) -> FloatArray:
        plant = Plant(damper)
        for level in known:
            plant.advance_many(np.full(held, x[0]), np.zeros(held), level, degrees)
        return plant.advance_many(x, np.full(count, speed), current, degrees)

    start, end = levels[-2:]
    before, after = (force(known, np.full(count, known[-1])) for known in (levels[:-1], levels))
    stepped = force(levels[:-1], np.where(np.arange(count) < at, start, end))
    return crossing_time((stepped[at:] - before[at:]) / (after[at:] - before[at:]), STEP_S)


def steps_of_campaign(usual: Campaign) -> dict[bool, list[tuple[tuple[float, ...], float]]]:
    """Return the steps of a campaign's runs, rises (true) apart from falls: levels so far, and the speed.

    Of a sequence that comes round again the second round is taken: the iron is no longer new.
    """
    assert usual.steps is not None
    levels, motion = usual.steps.levels, motion_from_text(usual.steps_motion)
    found: dict[bool, list[tuple[tuple[float, ...], float]]] = {True: [], False: []}
    for k in range(len(levels) // 2 + 1, len(levels)):
        speed = float(motion.velocity(k * usual.steps.hold + 1e-3))
        found[levels[k] > levels[k - 1]].append((levels[: k + 1], speed))
    return found


def print_steps(preset: str, draw: int) -> None:
    """Print the times that were identified beside the plant's, mean over rises and over falls."""
    usual = usual_campaign(damper := _damper(preset, draw))
    small = replace(_smaller(usual), motions=tuple(each for each in usual.motions if "chirp" not in each))
    found = fit([run for run, _ in measure(damper, small, seed=draw)], starts=1).actuation
    assert found is not None
    warm = _TEMPERATURES_degC if "hydraulic" in preset else _TEMPERATURES_degC[:1]
    steps = steps_of_campaign(usual)
    times = [
        1e3 * np.mean([plant_t63_s(damper, *step, t) for step in steps[rises] for t in warm])
        for rises in (True, False)
    ]
    print(
        f"{preset} {draw}: rise {times[0]:.1f} ms, identified {1e3 * found.t63_s:.1f} "
        f"+- {1e3 * found.t63_error_s:.1f}; fall {times[1]:.1f} ms, identified {1e3 * found.t63_fall_s:.1f} "
        f"+- {1e3 * found.t63_fall_error_s:.1f}; driver of {found.driver_quadrants} quadrants",
        flush=True,
    )


def print_promises(name: str, promises: Sequence[Promise], z: float) -> None:
    """Print one line of figures."""
    covered = np.concatenate([each.covered_percent for each in promises])
    found = np.concatenate([each.found_percent for each in promises])
    promised = float(np.mean([each.promised_percent for each in promises]))
    print(
        f"{name:24s} covered {covered.mean():.1f} % (lowest {covered.min():.0f}), promised {promised:.2f} %, "
        f"found {np.median(found):5.2f} %, ratio {np.median(found) / promised:4.2f}, rms z {z:4.2f}",
        flush=True,
    )


def main() -> None:
    """Judge cards of real runs, or of drawn dampers."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--runs", nargs="*", default=[])
    parser.add_argument("--preset", default="nominal")
    parser.add_argument("--draws", nargs="*", type=int, default=[])
    parser.add_argument("--steps", action="store_true")
    given = parser.parse_args()
    if given.steps:
        for draw in given.draws:
            print_steps(given.preset, draw)
        return
    sets = [("runs", list(read_runs(given.runs)), False)] if given.runs else []
    sets += [(f"{given.preset} {draw}", drawn(given.preset, draw), True) for draw in given.draws]
    for name, runs, groups in sets:
        print_promises(name, held_out_motions(runs, terms=groups), disjoint_z(runs))


if __name__ == "__main__":
    main()
