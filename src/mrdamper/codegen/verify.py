"""The check of an export: its C compiled here, run over the envelope, and compared with the extension.

The program that is compiled is the one that is shipped (``main.c`` replays a CSV), from the very texts of
``c_files``. What it gives must be what Python gives: the same bits in single precision, 1e-12 relative in
double. Beside that, every output must be finite, and every command within 0 and its largest.
"""

from __future__ import annotations

import os
import platform
import re
import shlex
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from mrdamper import __version__
from mrdamper.arrays import FloatArray
from mrdamper.codegen.c_code import c_files, sources_sha256, tables_bytes
from mrdamper.codegen.record import Difference, Verification
from mrdamper.codegen.target import Target
from mrdamper.codegen.verification_rows import COLUMNS, envelope_rows
from mrdamper.codegen.verify_thermal import thermal_problems, verify_thermal
from mrdamper.control.controllers import ForceController
from mrdamper.control.realtime import RealtimeDamper
from mrdamper.control.stepper import Flag, StateEstimate
from mrdamper.errors import CheckError, InputError

FLAGS = ("-std=c99", "-O2", "-ffp-contract=off")
WARNINGS = (
    "-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion", "-Wshadow", "-Wcast-qual", "-pedantic",
    "-Werror",
)  # fmt: skip

DOUBLE_TOLERANCE = 1e-12
"""Relative, in double precision; single precision must have the same bits."""

_CHUNK = 500  # samples between two looks at what a state believes
_COMMON = {"displacement": "displacement_m", "temperature": "temperature_K"}
_LONGEST_s = 300.0  # that a compiler or the replay may take


def verify_c(target: Target, *, samples: int = 100_000, seed: int = 1) -> Verification:
    """Compile a target's C, run it over the envelope and compare it with Python.

    Raises
    ------
    InputError
        There is no C compiler.
    CheckError
        The compiler does not take the code, or its program does not run to its end.
    """
    compiler = find_compiler()
    sources = c_files(target)
    rows = rounded(target, envelope_rows(target, samples, seed))
    with tempfile.TemporaryDirectory(prefix="mrdamper-verify-") as folder:
        place = Path(folder)
        for name, text in sources.items():
            (place / name).write_bytes(text.encode("utf-8"))
        gnu = _is_gnu(compiler)
        flags = (*FLAGS, *WARNINGS) if gnu else ("-O2",)
        program = _build(target, place, compiler, flags, usage=gnu)
        found = replay(target, program, rows, place)
        stack, sizes = _stack_of(place), _sizes_of(target, place, compiler)
        thermal = verify_thermal(target, place, lambda units, out: _link(compiler, flags, place, units, out))
    outputs, problems, flags_raised = compare(target, rows, found)
    problems += thermal_problems(thermal, single=target.single)
    readings = np.stack([rows[name] for name in _inputs(target)])
    return Verification(
        passed=not problems,
        sources_sha256=sources_sha256(sources),
        precision=target.precision,
        samples=samples,
        seed=seed,
        tolerance_relative=0.0 if target.single else DOUBLE_TOLERANCE,
        outputs=outputs,
        thermal_K=thermal,
        problems=tuple(problems),
        covered={name: _ends(rows[name]) for name in _inputs(target)},
        readings_not_finite=int(np.count_nonzero(~np.isfinite(readings))),
        flags_raised=flags_raised,
        compiler=" ".join(compiler),
        compiler_version=_version_of(compiler),
        compiler_flags=flags,
        machine=f"{platform.system()} {platform.machine()}",
        stack_bytes=stack,
        sizes_bytes=sizes,
        mrdamper=__version__,
    )


def not_verified(target: Target) -> Verification:
    """Return the record of an export that was asked not to be verified."""
    return Verification(
        passed=False,
        sources_sha256=sources_sha256(c_files(target)),
        precision=target.precision,
        problems=("not verified: it was asked for without",),
        mrdamper=__version__,
    )


def find_compiler() -> tuple[str, ...]:
    """Return the machine's C compiler as a command: the environment's CC, else cc, gcc or clang."""
    named = shlex.split(os.environ.get("CC", ""))
    for command in (named, ["cc"], ["gcc"], ["clang"]):
        if command and shutil.which(command[0]):
            return tuple(command)
    raise InputError(
        found=(
            "there is no C compiler (looked for $CC, cc, gcc, clang); an export is compiled here and "
            "compared with the model before it is written"
        ),
        remedy="Install gcc or clang, or use ⟦--no-verify⟧, which writes the C folder unproved",
    )


def rounded(target: Target, rows: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Return inputs as the target's number type holds them."""
    if not target.single:
        return dict(rows)
    with np.errstate(over="ignore"):
        return {name: values.astype(np.float32).astype(np.float64) for name, values in rows.items()}


def replay(
    target: Target, program: Sequence[str | Path], rows: Mapping[str, FloatArray], folder: Path
) -> dict[str, FloatArray]:
    """Run the replay program over rows; return its columns by name.

    Parameters
    ----------
    program : command that takes the names of two CSV files
    folder : for the two files
    """
    names = _csv_names(target)
    given, got = folder / "given.csv", folder / "got.csv"
    table = np.column_stack([rows[name] for name in names])
    header = ",".join(names.values())
    np.savetxt(
        given, table, delimiter=",", header=header, comments="", fmt="%.9g" if target.single else "%.17g"
    )
    done = _run([*map(str, program), str(given), str(got)], folder)
    if done.returncode != 0:
        raise CheckError(
            place="verification", found=f"the compiled replay ended with {done.returncode}: {_first(done)}"
        )
    columns = got.read_text(encoding="ascii").partition("\n")[0].split(",")
    values = np.loadtxt(got, delimiter=",", skiprows=1, ndmin=2)
    return rounded(target, dict(zip(columns, values.T, strict=True)))


def compare(
    target: Target, rows: Mapping[str, FloatArray], found: Mapping[str, FloatArray]
) -> tuple[dict[str, Difference], list[str], dict[str, dict[str, int]]]:
    """Return, for what a replay gave: the worst of each output, what is wrong, the flags that were raised."""
    outputs: dict[str, Difference] = {}
    problems: list[str] = []
    flags_raised: dict[str, dict[str, int]] = {}
    for part, (columns, expected, at) in expectations(target, rows).items():
        for output, values in expected.items():
            column = found[columns[output]]
            given = column[at] if len(values) < len(column) else column
            name = f"{part}.{output}"
            outputs[name] = difference(given, values, single=target.single)
            problems += _problems_of(target, name, given, outputs[name])
        raised = expected["flags"].astype(np.int64)
        flags_raised[part] = {
            str(flag.name): int(np.count_nonzero(raised & flag)) for flag in Flag if np.any(raised & flag)
        }
    return outputs, problems, flags_raised


def difference(given: FloatArray, expected: FloatArray, *, single: bool) -> Difference:
    """Return how far two columns are from each other, in bits of the number type and relative."""
    kind, bits = (np.float32, np.int32) if single else (np.float64, np.int64)
    patterns = [values.astype(kind).view(bits) for values in (given, expected)]
    differ = np.flatnonzero(patterns[0] != patterns[1])
    if not len(differ):
        return Difference(0, 0.0, 0, None)
    least = int(np.iinfo(bits).min)
    places = [[int(p) if p >= 0 else least - int(p) for p in column[differ]] for column in patterns]
    ulp = max(abs(a - b) for a, b in zip(*places, strict=True))
    one, other = given[differ], expected[differ]
    with np.errstate(all="ignore"):
        relative = np.where(one == other, 0.0, np.abs(one - other) / np.abs(other))
    worst = float(np.nan_to_num(relative, nan=1e300, posinf=1e300).max())
    return Difference(ulp, worst, len(differ), int(differ[0]))


def expectations(
    target: Target, rows: Mapping[str, FloatArray]
) -> dict[str, tuple[dict[str, str], dict[str, FloatArray], slice]]:
    """Return what Python gives, by part: the replay's columns, the outputs, and the samples of sparse ones.

    What a state holds (the applied command, the controller's force) is looked at once in ``_CHUNK`` samples.
    """
    expected: dict[str, tuple[dict[str, str], dict[str, FloatArray], slice]] = {}
    at = slice(_CHUNK - 1, None, _CHUNK)
    unit = target.command_unit
    if target.model is not None:
        columns = {"force": "force_N", "applied": f"applied_{unit}", "flags": "model_flags"}
        inputs = np.column_stack(
            [rows[name] for name in ("displacement", "velocity", "current", "temperature")]
        )
        force, flags, estimates = _by_chunks(target.model, inputs)
        applied = np.array([estimate.applied for estimate in estimates])
        expected["model"] = (columns, {"force": force, "applied": applied, "flags": flags}, at)
    if target.controller is not None:
        columns = {
            "current": _command_column(target), "force": "controller_force_N", "flags": "controller_flags",
        }  # fmt: skip
        names = ("wanted", "wanted_ahead", "displacement", "temperature", "force")
        current, flags, estimates = _by_chunks(target.controller, np.column_stack([rows[n] for n in names]))
        held = np.array([_summed(estimate, single=target.single) for estimate in estimates])
        expected["controller"] = (columns, {"current": current, "force": held, "flags": flags}, at)
    return expected


# ------------------------------------------------------------------------------------------- in Python


def _by_chunks(
    part: ForceController | RealtimeDamper, inputs: FloatArray
) -> tuple[FloatArray, FloatArray, list[StateEstimate]]:
    """Run a part; return its output, its flags, and the estimated state at the end of each chunk."""
    state = part.start()
    values, flags, estimates = [], [], []
    for start in range(0, len(inputs), _CHUNK):
        state, value, flag = part.run(state, inputs[start : start + _CHUNK])
        values.append(value)
        flags.append(flag.astype(np.float64))
        if len(value) == _CHUNK:
            estimates.append(part.estimate(state))
    return np.concatenate(values), np.concatenate(flags), estimates


def _summed(estimate: StateEstimate, *, single: bool) -> float:
    """Return the model's force [N] added up in the target's number type."""
    kind = np.float32 if single else np.float64
    parts = (estimate.yield_force, estimate.viscous_force, estimate.friction_force, estimate.other_force)
    total = kind(parts[0])
    for part in parts[1:]:
        total = total + kind(part)
    return float(total)


def _problems_of(target: Target, name: str, given: FloatArray, found: Difference) -> list[str]:
    problems = []
    if not np.isfinite(given).all():
        first = int(np.flatnonzero(~np.isfinite(given))[0])
        problems.append(f"{name} is not finite (sample {first})")
    if name.endswith(".current") and not ((given >= 0.0) & (given <= target.largest * (1.0 + 1e-6))).all():
        problems.append(f"{name} leaves 0 to {target.largest:g} {target.command_unit}")
    exact = target.single or name.endswith(".flags")
    if found.samples_differing > 0 if exact else found.relative > DOUBLE_TOLERANCE:
        problems.append(
            f"{name} is not Python's at {found.samples_differing} samples, first at {found.first_sample}: "
            f"up to {found.ulp} units in the last place, {found.relative:.1e} relative; expected "
            f"{'the same bits' if exact else f'{DOUBLE_TOLERANCE:g}'}"
        )
    return problems


def _inputs(target: Target) -> tuple[str, ...]:
    """Return the inputs that a target has."""
    return tuple(
        name
        for name in COLUMNS
        if name in _COMMON
        or (name in ("velocity", "current") and target.model is not None)
        or (name in ("wanted", "wanted_ahead", "force") and target.controller is not None)
    )


def _csv_names(target: Target) -> dict[str, str]:
    """Return input -> column of the replay program."""
    every = {
        **_COMMON, "velocity": "velocity_m_s", "current": _command_column(target), "wanted": "wanted_N",
        "wanted_ahead": "wanted_ahead_N", "force": "force_N",
    }  # fmt: skip
    return {name: every[name] for name in _inputs(target)}


def _command_column(target: Target) -> str:
    return "current_A" if target.command_unit == "A" else "voltage_V"


def _ends(values: FloatArray) -> tuple[float, float]:
    """Return the lowest and highest that is a reading: finite, and no fault of a thousand times the rest."""
    finite = values[np.isfinite(values)]
    usual = 1e3 * float(np.median(np.abs(finite))) if len(finite) else 0.0
    kept = finite[np.abs(finite) <= usual]
    return (float(kept.min()), float(kept.max())) if len(kept) else (0.0, 0.0)


# ------------------------------------------------------------------------------------ with the compiler


def _build(
    target: Target, place: Path, compiler: Sequence[str], flags: Sequence[str], *, usage: bool
) -> list[str]:
    """Compile the library's two files and the replay program, each on its own; return the program."""
    usage_flags = ["-fstack-usage"] if usage else []
    _compile([*compiler, *flags, *usage_flags, "-c", f"{target.name}.c", "-o", f"{target.name}.o"], place)
    name = target.name
    thermal = () if target.thermal is None else (f"{name}_thermal",)
    units = (name, f"{name}_tables", *thermal, "main")
    return _link(compiler, flags, place, units, "replay")


def _link(
    compiler: Sequence[str], flags: Sequence[str], place: Path, units: Sequence[str], program: str
) -> list[str]:
    """Compile the units that are not compiled yet, each on its own, and link them; return the program."""
    for unit in units:
        if not (place / f"{unit}.o").exists():
            _compile([*compiler, *flags, "-c", f"{unit}.c", "-o", f"{unit}.o"], place)
    _compile([*compiler, *(f"{unit}.o" for unit in units), "-o", str(place / program)], place)
    return [str(place / program)]


def _compile(command: Sequence[str], place: Path) -> None:
    done = _run(command, place)
    if done.returncode != 0:
        raise CheckError(
            f"{shlex.join(command)} failed: {_first(done)}",
            place="verification",
            expected="code that compiles without a warning",
            remedy="Report this, or compile with another compiler (CC=...)",
        )


def _run(command: Sequence[str], place: Path) -> subprocess.CompletedProcess[str]:
    plain = {**os.environ, "LC_ALL": "C"}
    try:
        return subprocess.run(
            command, cwd=place, capture_output=True, text=True, check=False, env=plain, timeout=_LONGEST_s
        )
    except subprocess.TimeoutExpired as fault:
        raise CheckError(
            place="verification", found=f"{shlex.join(command)} took more than {_LONGEST_s:g} s"
        ) from fault
    except OSError as fault:
        raise CheckError(
            place="verification", found=f"{command[0]} cannot be run: {fault.strerror}"
        ) from fault


def _first(done: subprocess.CompletedProcess[str]) -> str:
    """Return what a program says first."""
    lines = (done.stderr.strip() or done.stdout.strip() or "it says nothing").splitlines()
    worst = [line for line in lines if "error" in line]
    return (worst or lines)[0].strip()


def _is_gnu(compiler: Sequence[str]) -> bool:
    """Say whether a compiler takes the flags of gcc and clang."""
    return bool(re.search(r"gcc|clang|free software foundation", _version_text(compiler), re.IGNORECASE))


def _version_of(compiler: Sequence[str]) -> str:
    lines = _version_text(compiler).splitlines()
    return lines[0].strip() if lines else ""


def _version_text(compiler: Sequence[str]) -> str:
    with tempfile.TemporaryDirectory() as folder:
        return _run([*compiler, "--version"], Path(folder)).stdout


def _stack_of(place: Path) -> dict[str, int]:
    """Return the stack frame of each function [bytes], as the compiler has it."""
    found: dict[str, int] = {}
    for path in place.glob("*.su"):
        for line in path.read_text(encoding="utf-8").splitlines():
            where, size, *_ = line.split("\t")
            found[where.rpartition(":")[2]] = int(size)
    return dict(sorted(found.items()))


def _sizes_of(target: Target, place: Path, compiler: Sequence[str]) -> dict[str, int]:
    """Return the sizes of tables, state and, where ``size`` is there, machine code [bytes]."""
    probe = (
        f'#include <stdio.h>\n#include "{target.name}.h"\n'
        'int main(void) { printf("%lu", (unsigned long)sizeof(mrd_track_state)); return 0; }\n'
    )
    (place / "probe.c").write_text(probe, encoding="ascii")
    _compile([*compiler, "probe.c", "-o", "probe"], place)
    sizes = {"tables": tables_bytes(target), "state": int(_run([str(place / "probe")], place).stdout)}
    if shutil.which("size"):
        listed = _run(["size", "-A", f"{target.name}.o"], place).stdout
        sections = re.findall(r"^(\.text\S*|\.rodata\S*)\s+(\d+)", listed, re.MULTILINE)
        sizes["code"] = sum(int(size) for _, size in sections)
    return sizes
