"""How well the default identification does on virtual dampers that share no form with the laws.

    python -m bench.zoo                                  # both hydraulic presets
    python -m bench.zoo hydraulic-bench --draws 0 2      # two drawn dampers beside the preset
    python -m bench.zoo nominal --gas 157 339            # beside a gas spring: of one force, of another

Each damper runs its usual campaign and is identified by default, without its held-out temperatures and chirp.
Errors are medians and worst of the held-out runs: nRMSE [%], RMS error over standard deviation of the force;
for random current over random motion RMS error over RMS force. By agreement even draws are for building laws
and choosing constants, odd ones for reporting.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Any

import numpy as np

from mrdamper.errors import MrdamperError
from mrdamper.excitation import Chirp
from mrdamper.identify.scores import RunError, least_command
from mrdamper.jobs.fit import fit
from mrdamper.jobs.options import FitOptions, RigOptions
from mrdamper.jobs.rig import MeasuredRun, RigResult, rig
from mrdamper.quantities import REFERENCE_K, ZERO_CELSIUS_K

__all__ = ["judge"]

_GAS_LENGTH_m, _POLYTROPIC = 0.1, 1.3  # volume over the rod's area; gas that exchanges some heat

_COLUMNS = ("held_out_above_0A", "held_out", "chirp_above_0A", "random", "cpu_s")


def judge(preset: str, draw: int | None = None, gas_N: float = 0.0) -> dict[str, Any]:
    """Return the errors of one damper's default card by kind of run, or why there is no card.

    Of a gas spring beside the damper ``gas_N`` is the force on the rod at 20 degC and mid-stroke.
    """
    tests = rig(RigOptions(preset=preset, draw=draw))
    if gas_N:
        tests = replace(tests, runs=tuple(_with_gas(each, gas_N) for each in tests.runs))
    try:
        found = fit(tests.dataset, options=FitOptions(hold_out=tests.campaign.hold_out))
    except MrdamperError as error:
        return {"damper": tests.damper.name, "no_card": str(error)}
    errors = [each for each in found.assessment.runs if each.split == "held_out"]
    return {
        "damper": tests.damper.name,
        "law": found.card().damper.law.name,
        **_by_kind(tests, errors),
        "cpu_s": found.cpu_s,
    }


def _with_gas(measured: MeasuredRun, force_N: float) -> MeasuredRun:
    """Return a run with the force of a gas on the rod: its pressure goes with its absolute temperature."""
    truth = measured.truth
    warmth = (truth.temperature_degC + ZERO_CELSIUS_K) / REFERENCE_K
    gas = -force_N * warmth * (1.0 + truth.displacement / _GAS_LENGTH_m) ** -_POLYTROPIC
    return replace(measured, run=replace(measured.run, force=measured.run.force + gas))


def _by_kind(tests: RigResult, errors: list[RunError]) -> dict[str, list[float] | None]:
    """Return median and worst of the held-out errors [%] of each kind of run."""
    planned = {each.plan.name: each for each in tests.runs}
    least = least_command(each.command for each in errors)
    steady = [each for each in errors if each.command is not None]
    chirp = [each for each in steady if isinstance(planned[each.name].plan.motion, Chirp)]
    known = [each for each in steady if each not in chirp]
    random = {
        each.name: 100.0 * each.rmse_N / float(np.sqrt(np.mean(planned[each.name].run.force ** 2)))
        for each in errors
        if planned[each.name].plan.label == "random"
    }
    return {
        "held_out_above_0A": _summary([e.nrmse_percent for e in known if (e.command or 0.0) > least]),
        "held_out": _summary([e.nrmse_percent for e in known]),
        "chirp_above_0A": _summary([e.nrmse_percent for e in chirp if (e.command or 0.0) > least]),
        "random": _summary(list(random.values())),
    }


def _summary(percent: list[float]) -> list[float] | None:
    return [float(np.median(percent)), max(percent)] if percent else None


def main() -> None:
    """Judge the dampers that are named and print a row of each."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("presets", nargs="*", default=["hydraulic-bench", "hydraulic-monotube"])
    asked.add_argument("--draws", type=int, nargs="*", default=[], help="beside each preset itself")
    asked.add_argument("--only-draws", action="store_true")
    asked.add_argument("--gas", type=float, nargs="*", default=[0.0], help="of a gas spring beside it [N]")
    given = asked.parse_args()
    print("damper, law:", *_COLUMNS, sep="  ")
    for preset in given.presets:
        for draw in [*([] if given.only_draws else [None]), *given.draws]:
            for gas in given.gas:
                row = judge(preset, draw, gas)
                name = f"{row['damper']} with a gas spring of {gas:g} N" if gas else row["damper"]
                print(name, _shown(row), sep=", ", flush=True)


def _shown(row: dict[str, Any]) -> str:
    if "no_card" in row:
        return f"no card: {row['no_card']}"
    cells = [row[name] for name in _COLUMNS]
    shown = (
        "-" if c is None else f"{c:.1f}" if isinstance(c, float) else f"{c[0]:.1f}/{c[1]:.1f}" for c in cells
    )
    return f"{row['law']}: " + "  ".join(shown)


if __name__ == "__main__":
    main()
