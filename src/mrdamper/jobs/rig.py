"""The job ``mrdamper rig``: run a campaign on the virtual rig and write what its sensors saw, and the truth.

The runs go to ``DIR``, as any rig's runs would. The truth (noise-free force, true temperature, the coil's
current, the damper's parameters) goes to ``DIR.truth`` beside it, which identification never opens. Both are
written when the whole campaign is done, or not at all.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.records import RigRun
from mrdamper.errors import InputError
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.rig.campaign import Campaign, PlannedRun
from mrdamper.rig.measurement import Truth, measure_run
from mrdamper.rig.plant import VirtualDamper, find_preset
from mrdamper.runtime.outputs import atomic_output
from mrdamper.schema import Json

__all__ = ["Report", "rig", "truth_folder", "write_campaign"]

Report = Callable[[int, int, str], None]
"""Told of every run: how many are done, how many there are, the name of the one that comes now."""


def rig(
    out: Path,
    *,
    preset: str = "nominal",
    damper_file: Path | None = None,
    campaign_file: Path | None = None,
    seed: int = 0,
    report: Report | None = None,
) -> Json:
    """Run a campaign on a virtual damper; write its runs into ``out`` and the truth beside it.

    Parameters
    ----------
    out : folder of the runs (CSV, one file each) and of their channel map ``channels.toml``
    preset : name of the damper's parameters, unless ``damper_file`` (TOML) gives them
    campaign_file : TOML; None is the default campaign
    seed : of the sensors' noise; the same seed gives the same bytes
    report : told of every run

    Raises
    ------
    InputError
        A file or an option that cannot be used; nothing is written then.
    """
    clock = time.process_time()
    damper = find_preset(preset) if damper_file is None else VirtualDamper.from_toml(damper_file)
    campaign = Campaign() if campaign_file is None else Campaign.from_toml(campaign_file)
    if seed < 0:
        raise InputError(f"seed is {seed}; expected zero or more")
    truth = truth_folder(out)
    with atomic_output(out) as beside, atomic_output(truth) as behind:
        rows = write_campaign(beside, behind, damper, campaign, seed=seed, report=report)
    strangers = sorted({path.stem for path in out.glob("*.csv")} - {row["name"] for row in rows})
    notes = []
    if strangers:
        notes.append(
            f"{out} holds other runs, {len(strangers)} of them, such as {strangers[0]}: identify takes every "
            "run in the folder"
        )
    return {
        "damper": damper.name,
        "seed": seed,
        "procedure": campaign.procedure,
        "folder": str(out),
        "truth": str(truth),
        "channels": str(out / "channels.toml"),
        "hold_out": list(campaign.hold_out),
        "runs": rows,
        "simulated": True,
        "cpu_s": round(time.process_time() - clock, 3),
        "notes": notes,
    }


def write_campaign(
    runs: Path,
    truth: Path,
    damper: VirtualDamper,
    campaign: Campaign,
    *,
    seed: int,
    report: Report | None = None,
) -> list[Json]:
    """Run a campaign; write its runs and its truth into two folders that are there; return a row per run."""
    planned = campaign.runs(damper.name)
    rows = []
    for done, plan in enumerate(planned):
        if report is not None:
            report(done, len(planned), plan.name)
        run, true = measure_run(damper, plan, campaign, seed=seed)
        _write_run(runs / f"{run.name}.csv", run)
        _write_truth(truth / f"{run.name}.csv", true)
        rows.append(_row(plan, run))
    (runs / "channels.toml").write_text(_channel_map(damper), encoding="utf-8")
    (truth / f"{damper.name}.damper.toml").write_text(damper.to_toml(), encoding="utf-8")
    (truth / f"{damper.name}.campaign.toml").write_text(campaign.to_toml(), encoding="utf-8")
    return rows


def truth_folder(out: Path) -> Path:
    """Return the folder of the truth beside a folder of runs: ``DIR.truth``."""
    place = out if out.name not in {"", ".."} else out.resolve()
    if not place.name:
        raise InputError(f"{out}: has nothing beside it for the truth; choose another ⟦--out⟧")
    return place.with_name(f"{place.name}.truth")


def _row(plan: PlannedRun, run: RigRun) -> Json:
    return {
        "name": plan.name,
        "motion": plan.label,
        "current_A": run.constant_command,  # None when it is stepped
        "temperature_degC": plan.temperature_degC,
        "duration_s": plan.duration_s,
        "samples": len(run),
        "held_out": plan.held_out,
    }


def _write_run(path: Path, run: RigRun) -> None:
    """Write a run as its logger would; the first line says that nobody measured it."""
    if run.temperature is None:  # never on this rig
        raise InputError(f"{run.name}: has no temperature; expected one")
    header = "time_s,displacement_m,force_N,current_A,temperature_degC"
    columns = (run.time, run.displacement, run.force, run.command, run.temperature - ZERO_CELSIUS_K)
    _write(path, f"{run.source}; not measured", header, "%.4f,%.7f,%.2f,%.4f,%.2f", columns)


def _write_truth(path: Path, true: Truth) -> None:
    header = "time_s,displacement_m,velocity_m_s,force_N,coil_current_A,temperature_degC"
    columns = (
        true.time, true.displacement, true.velocity, true.force, true.coil_current, true.temperature_degC,
    )  # fmt: skip
    _write(path, "the truth of a simulated run", header, "%.4f,%.9f,%.9f,%.5f,%.7f,%.5f", columns)


def _write(path: Path, label: str, header: str, form: str, columns: Iterable[FloatArray]) -> None:
    table = np.column_stack(tuple(columns))
    lines = (f"{form}\n" * len(table)) % tuple(table.ravel().tolist())
    path.write_text(f"# {label}\n{header}\n{lines}", encoding="utf-8")


def _channel_map(damper: VirtualDamper) -> str:
    """Return a channel map: the headers speak for themselves, the session does not."""
    columns = (
        ("time", "s"),
        ("displacement", "m"),
        ("force", "N"),
        ("current", "A"),
        ("temperature", "degC"),
    )
    lines = [
        "# The headers of these files speak for themselves: `mrdamper identify DIR` needs no map.",
        "# With it (--channels), the runs are one session: they share one tare of the force cell.",
        "[session]",
        f'name = "virtual rig {damper.name}"',
    ]
    for role, unit in columns:
        lines += [f"[channel.{role}]", f'name = "{role}_{unit}"', f'unit = "{unit}"']
    return "\n".join([*lines, ""])
