"""Promises of cards beside what unseen motions give: coverage of the band, expected error, standard errors.

Each motion is held out in turn; a card is made of the others and judged on it. Standard errors are compared
between cards of disjoint sets of motions. Real runs from a folder, and drawn virtual dampers: even draws were
used to choose the band's constants, odd ones are blind.


    python -m bench.promises --preset nominal --draws 1 3 5
    python -m bench.promises --runs data/dev/utfsm_sine_*.csv
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mrdamper.data.prepare import Preparation, PreparedRun
from mrdamper.data.readers import read_runs
from mrdamper.data.records import RigRun
from mrdamper.identify.fit import Identification, fit
from mrdamper.identify.motions import folds_of, motion_groups
from mrdamper.identify.predict import prepare_all
from mrdamper.identify.scores import score_run
from mrdamper.rig.campaign import usual_campaign
from mrdamper.rig.damper import draw_variant, find_preset
from mrdamper.rig.measurement import measure

_MOTIONS = ("sine:8mm:0.5Hz", "sine:4mm:1.5Hz")  # beside the usual ones
_TEMPERATURES_degC = (20.0, 70.0, 120.0)


@dataclass(frozen=True)
class Promise:
    """What cards made without one motion promised of it, and what it gave."""

    promised_percent: float
    found_percent: tuple[float, ...]
    covered_percent: tuple[float, ...]


def held_out_motions(runs: Sequence[RigRun], *, groups: bool, starts: int) -> list[Promise]:
    """Return the promise and what was found, for each motion (or fold of motions) held out."""
    prepared = prepare_all(runs, Preparation())
    raw = {run.name: run for run in runs}
    apart: Iterable[Sequence[int]] = (
        motion_groups(prepared) if groups else [fold.runs for fold in folds_of(prepared)]
    )
    found = []
    for left in apart:
        kept = [raw[run.name] for k, run in enumerate(prepared) if k not in set(left)]
        fitted = fit(kept, starts=starts)
        assert fitted.force_band is not None
        band = fitted.force_band
        errors = [score_run(fitted.damper, prepared[k], band=band) for k in left]
        inside = tuple(error.in_band_percent or 0.0 for error in errors)
        found.append(Promise(band.expected_nrmse_percent, tuple(e.nrmse_percent for e in errors), inside))
    return found


def disjoint_z(runs: Sequence[RigRun], *, starts: int) -> float:
    """Return the rms difference of parameters between cards of two halves of the motions, in errors."""
    prepared: tuple[PreparedRun, ...] = prepare_all(runs, Preparation())
    raw, groups = {run.name: run for run in runs}, motion_groups(prepared)
    sides: list[Identification] = []
    for half in (groups[::2], groups[1::2]):
        sides.append(fit([raw[prepared[k].name] for group in half for k in group], starts=starts))
    one, other = ({e.name: e for e in side.estimates} for side in sides)
    off = [
        (one[name].value - other[name].value) / np.hypot(one[name].standard_error, other[name].standard_error)
        for name in one.keys() & other.keys()
    ]
    known = np.array([z for z in off if np.isfinite(z)])
    return float(np.sqrt(np.mean(known**2)))


def drawn(preset: str, draw: int) -> list[RigRun]:
    """Return the runs at constant current of a drawn damper (0: the preset), on five or six motions."""
    damper = draw_variant(find_preset(preset), draw) if draw else find_preset(preset)
    usual = usual_campaign(damper)
    small = replace(
        usual,
        motions=(*usual.motions, *(() if "monotube" in preset else _MOTIONS)),
        currents_A=usual.currents_A[::2],
        temperatures_degC=_TEMPERATURES_degC,
        held_out_temperatures_degC=(),
        held_out_motions=(),
        steps=None,
        random=None,
        duration_s=3.0,
    )
    return [run for run, _ in measure(damper, small, seed=draw)]


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
    given = parser.parse_args()
    sets = [("runs", list(read_runs(given.runs)), False)] if given.runs else []
    sets += [(f"{given.preset} {draw}", drawn(given.preset, draw), True) for draw in given.draws]
    for name, runs, groups in sets:
        starts = 1
        print_promises(
            name, held_out_motions(runs, groups=groups, starts=starts), disjoint_z(runs, starts=starts)
        )


if __name__ == "__main__":
    main()
