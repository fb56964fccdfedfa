"""Output of the command ``rig``, which simulates tests of a virtual damper.

The runs, with sensor errors, are written to the folder ``DIR``. Force, motion and current without sensor
errors are written to ``DIR.truth``. Files are written only if the whole campaign is complete.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from rich.console import Console

from mrdamper.arrays import FloatArray
from mrdamper.data.records import RigRun
from mrdamper.errors import InputError
from mrdamper.excitation import CurrentSteps, RandomCurrent
from mrdamper.jobs.rig import MeasuredRun, RigResult
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.report.base import Report, WrittenFile
from mrdamper.report.page import sentence
from mrdamper.report.sections import terminal_table
from mrdamper.schema import Json
from mrdamper.virtual_rig.damper import VirtualDamper, damper_to_toml
from mrdamper.virtual_rig.measurement import Truth


def _fields(found: RigResult) -> dict[str, object]:
    return {
        "damper": found.damper.name,
        "seed": found.seed,
        "hold_out": list(found.campaign.hold_out),
        "runs": _rows(found),
        "simulated": True,
        "cpu_s": round(found.cpu_s, 3),
        "notes": [],
    }


def _rows(found: RigResult) -> list[Json]:
    return [
        {
            "name": each.plan.name,
            "motion": each.plan.label,
            "current_A": each.run.constant_command,  # None if the current changes
            "temperature_degC": each.plan.temperature_degC,
            "duration_s": each.plan.duration_s,
            "samples": len(each.run),
            "held_out": each.plan.held_out,
        }
        for each in found.runs
    ]


def _in_folder(found: RigResult, out: Path) -> Json:
    """Return the paths of the written files, and a note if the folder has runs of another campaign."""
    others = sorted({path.stem for path in out.glob("*.csv")} - {each.plan.name for each in found.runs})
    notes = []
    if others:
        notes.append(
            f"{out} has {len(others)} other runs, such as {others[0]}: fit reads every run in the folder"
        )
    return {
        "folder": str(out),
        "truth": str(truth_folder(out)),
        "channels": str(out / "channels.toml"),
        "notes": notes,
    }


def _show(found: RigResult, console: Console) -> None:
    rows = []
    for motion in dict.fromkeys(each.plan.label for each in found.runs):
        runs = [each for each in found.runs if each.plan.label == motion]
        currents = dict.fromkeys(_current_of(each) for each in runs)
        degrees = dict.fromkeys(f"{each.plan.temperature_degC:g}" for each in runs)
        held_out = sum(each.plan.held_out for each in runs)
        rows.append((motion, str(len(runs)), str(held_out), ", ".join(currents), ", ".join(degrees)))
    title = f"Virtual damper {found.damper.name}, seed {found.seed}: runs by motion"
    names = ("motion", "runs", "held out", "currents A", "temperatures degC")
    console.print(terminal_table(title, names, rows, left=("motion", "currents A", "temperatures degC")))


def _current_of(measured: MeasuredRun) -> str:
    """Return the planned current of a run as text."""
    given = measured.plan.current
    if isinstance(given, RandomCurrent):
        return f"random, up to {given.highest:g}"
    return "stepped" if isinstance(given, CurrentSteps) else f"{given:g}"


def _closing(found: RigResult, answer: Json) -> list[str]:
    """Return lines with the folders of the runs and of the exact values, notes and the next command."""
    folder = answer["folder"]
    held_out = [word for pattern in found.campaign.hold_out for word in ("--hold-out", f"'{pattern}'")]
    return [
        f"Wrote {len(found.runs)} runs to {folder}.",
        f"Exact values, for comparison only: {answer['truth']}",
        *(f"Note: {sentence(note)}" for note in answer["notes"]),
        f"Next: mrdamper fit {' '.join([folder, *held_out])} --out card",
    ]


def _summary(found: RigResult) -> list[str]:
    held = sum(each.plan.held_out for each in found.runs)
    return [
        f"virtual damper {found.damper.name}, seed {found.seed}: {len(found.runs)} runs, {held} held out",
        f"motions: {', '.join(dict.fromkeys(each.plan.label for each in found.runs))}",
    ]


def write_runs(found: RigResult, folder: Path) -> None:
    """Write the runs as CSV files with a channel map, in the format of a data logger."""
    for each in found.runs:
        _write_run(folder / f"{each.run.name}.csv", each.run)
    (folder / "channels.toml").write_text(_channel_map(found.damper), encoding="utf-8")


def _write_truths(found: RigResult, folder: Path) -> None:
    name = found.damper.name
    for each in found.runs:
        _write_truth(folder / f"{each.run.name}.csv", each.truth)
    (folder / f"{name}.damper.toml").write_text(damper_to_toml(found.damper), encoding="utf-8")
    (folder / f"{name}.campaign.toml").write_text(found.campaign.to_toml(), encoding="utf-8")


def truth_folder(out: Path) -> Path:
    """Return the folder of the exact values, which is ``DIR.truth`` for runs in ``DIR``."""
    path = out if out.name not in {"", ".."} else out.resolve()
    if not path.name:
        raise InputError("has no parent folder for DIR.truth", place=out, remedy="choose another --out")
    return path.with_name(f"{path.name}.truth")


def _write_run(path: Path, run: RigRun) -> None:
    """Write a run as CSV. The first line states that the run is simulated."""
    assert run.temperature is not None  # Runs of the virtual rig always have a temperature.
    header = "time_s,displacement_m,force_N,current_A,temperature_degC"
    columns = (run.time, run.displacement, run.force, run.command, run.temperature - ZERO_CELSIUS_K)
    _write(path, f"{run.source}; not measured", header, "%.4f,%.7f,%.2f,%.4f,%.2f", columns)


def _write_truth(path: Path, true: Truth) -> None:
    header = "time_s,displacement_m,velocity_m_s,force_N,coil_current_A,temperature_degC"
    columns = (
        true.time, true.displacement, true.velocity, true.force, true.coil_current, true.temperature_degC,
    )  # fmt: skip
    _write(path, "exact values of a simulated run", header, "%.4f,%.9f,%.9f,%.5f,%.7f,%.5f", columns)


def _write(path: Path, label: str, header: str, form: str, columns: Iterable[FloatArray]) -> None:
    table = np.column_stack(tuple(columns))
    lines = (f"{form}\n" * len(table)) % tuple(table.ravel().tolist())
    path.write_text(f"# {label}\n{header}\n{lines}", encoding="utf-8")


def _channel_map(damper: VirtualDamper) -> str:
    """Return the channel map, which states names and units of the CSV columns."""
    columns = (
        ("time", "s"),
        ("displacement", "m"),
        ("force", "N"),
        ("current", "A"),
        ("temperature", "degC"),
    )
    lines = [
        "# The headers of these files name quantity and unit. `mrdamper fit DIR` needs no channel map.",
        "# With mrdamper fit --channels FILE, all runs belong to one session with one zero of the load cell.",
        "[session]",
        f'name = "virtual rig {damper.name}"',
    ]
    for role, unit in columns:
        lines += [f"[channel.{role}]", f'name = "{role}_{unit}"', f'unit = "{unit}"']
    return "\n".join([*lines, ""])


REPORT = Report(
    fields=_fields,
    show=_show,
    closing=_closing,
    summary=_summary,
    files=(
        WrittenFile(name="", write=write_runs),
        WrittenFile(name="", write=_write_truths, folder="truth"),
    ),
    beside={"truth": truth_folder},
    in_folder=_in_folder,
    rows=_rows,
)
