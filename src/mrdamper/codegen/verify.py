"""Verify an export: compile the generated C code, run it, and compare its outputs with the Python model.

The compiled program belongs to the export (``main.c`` reads the inputs from a CSV file). The inputs are
inside and outside the envelope of the model card, and some readings are invalid. In single precision, the
outputs must be bit-identical to Python. In double precision, the relative difference must not exceed 1e-12.
Every output must be finite, and every command must be between 0 and the largest command.
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
from mrdamper.codegen.verification_rows import envelope_rows, replay_columns, replay_outputs
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
"""Relative tolerance in double precision. In single precision, the outputs must be bit-identical."""

STATE_SAMPLE_COUNT = 500  # Applied command and controller force are compared at every 500th sample only.


def verify_c(target: Target, *, samples: int = 100_000, seed: int = 1) -> Verification:
    """Compile and run the C code of a target, compare its outputs with Python, and return the record.

    Raises
    ------
    InputError
        If there is no C compiler.
    CheckError
        If the compiler rejects the code or the compiled program fails.
    """
    compiler = find_compiler()
    sources = c_files(target)
    rows = round_rows(target, envelope_rows(target, samples, seed))
    with tempfile.TemporaryDirectory(prefix="mrdamper-verify-") as folder:
        place = Path(folder)
        for name, text in sources.items():
            (place / name).write_bytes(text.encode("utf-8"))
        gnu = _accepts_gcc_flags(compiler)
        flags = (*FLAGS, *WARNINGS) if gnu else ("-O2",)
        program = _build(target, place, compiler, flags, usage=gnu)
        outputs_of_c = replay(target, program, rows, place)
        stack, sizes = _stack_of(place), _sizes_of(target, place, compiler)
        thermal = verify_thermal(target, place, lambda units, out: _link(compiler, flags, place, units, out))
    outputs, problems, flags_raised = compare(target, rows, outputs_of_c)
    problems += thermal_problems(thermal, single=target.single)
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
        flags_raised=flags_raised,
        compiler=" ".join(compiler),
        compiler_version=_version_text(compiler).partition("\n")[0].strip(),
        compiler_flags=flags,
        machine=f"{platform.system()} {platform.machine()}",
        stack_bytes=stack,
        sizes_bytes=sizes,
        mrdamper=__version__,
    )


def find_compiler() -> tuple[str, ...]:
    """Return the command of a C compiler: environment variable CC, otherwise cc, gcc or clang."""
    named = shlex.split(os.environ.get("CC", ""))
    for command in (named, ["cc"], ["gcc"], ["clang"]):
        if command and shutil.which(command[0]):
            return tuple(command)
    raise InputError(
        found=(
            "there is no C compiler (looked for $CC, cc, gcc, clang); an export is compiled and compared "
            "with the model before it is written"
        ),
        remedy="Install gcc or clang, or set CC to a compiler command",
    )


def round_rows(target: Target, rows: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Round all inputs to the number type of the target (float or double)."""
    if not target.single:
        return dict(rows)
    with np.errstate(over="ignore"):
        return {name: values.astype(np.float32).astype(np.float64) for name, values in rows.items()}


def replay(
    target: Target, program: Sequence[str | Path], rows: Mapping[str, FloatArray], folder: Path
) -> dict[str, FloatArray]:
    """Run the replay program with the inputs ``rows``; return its outputs by column name, shape (samples,).

    Parameters
    ----------
    program : command, to which the paths of the input and the output CSV file are added
    folder : folder for the two CSV files
    """
    names = replay_columns(target)
    given, got = folder / "given.csv", folder / "got.csv"
    table = np.column_stack([rows[name] for name in names])
    header = ",".join(names.values())
    np.savetxt(
        given, table, delimiter=",", header=header, comments="", fmt="%.9g" if target.single else "%.17g"
    )
    done = _run([*map(str, program), str(given), str(got)], folder)
    if done.returncode != 0:
        raise CheckError(
            place="verification",
            found=f"the compiled replay ended with {done.returncode}: {_first_error(done)}",
        )
    columns = got.read_text(encoding="ascii").partition("\n")[0].split(",")
    values = np.loadtxt(got, delimiter=",", skiprows=1, ndmin=2)
    return round_rows(target, dict(zip(columns, values.T, strict=True)))


def compare(
    target: Target, rows: Mapping[str, FloatArray], found: Mapping[str, FloatArray]
) -> tuple[dict[str, Difference], list[str], dict[str, dict[str, int]]]:
    """Compare the outputs of a replay with Python; return differences, problems and flag counts.

    The differences are the largest difference of each output. The problems are one sentence each. The flag
    counts are the number of samples with each flag, for each part (model, controller).
    """
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
    """Return the largest difference of two columns: relative, and in units in the last place (ulp).

    ``single`` is True if an ulp refers to float, and False for double.
    """
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
    """Return column names, expected outputs and compared samples by part of the export.

    The parts are ``model`` and ``controller``. The first item of a tuple has the column of the replay program
    for each output, the second item the outputs computed in Python. The third item selects the samples at
    which the applied command and the controller force are compared (every ``STATE_SAMPLE_COUNT``-th sample).
    """
    expected: dict[str, tuple[dict[str, str], dict[str, FloatArray], slice]] = {}
    at = slice(STATE_SAMPLE_COUNT - 1, None, STATE_SAMPLE_COUNT)
    columns = replay_outputs(target)
    if target.model is not None:
        names: tuple[str, ...] = ("displacement", "velocity", "current", "temperature")
        force, flags, estimates = _run_in_python(
            target.model, np.column_stack([rows[name] for name in names])
        )
        applied = np.array([estimate.applied for estimate in estimates])
        expected["model"] = (columns["model"], {"force": force, "applied": applied, "flags": flags}, at)
    if target.controller is not None:
        names = ("wanted", "wanted_ahead", "displacement", "temperature", "force")
        current, flags, estimates = _run_in_python(
            target.controller, np.column_stack([rows[name] for name in names])
        )
        held = np.array([_summed(estimate, single=target.single) for estimate in estimates])
        expected["controller"] = (
            columns["controller"], {"current": current, "force": held, "flags": flags}, at,
        )  # fmt: skip
    return expected


def _run_in_python(
    part: ForceController | RealtimeDamper, inputs: FloatArray
) -> tuple[FloatArray, FloatArray, list[StateEstimate]]:
    state = part.start()
    values, flags, estimates = [], [], []
    for start in range(0, len(inputs), STATE_SAMPLE_COUNT):
        state, value, flag = part.run(state, inputs[start : start + STATE_SAMPLE_COUNT])
        values.append(value)
        flags.append(flag.astype(np.float64))
        if len(value) == STATE_SAMPLE_COUNT:
            estimates.append(part.estimate(state))
    return np.concatenate(values), np.concatenate(flags), estimates


def _summed(estimate: StateEstimate, *, single: bool) -> float:
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
            f"{name} differs from Python in {found.samples_differing} samples, first at sample "
            f"{found.first_sample}: up to {found.ulp} units in the last place, {found.relative:.1e} "
            "relative; expected "
            f"{'the same bits' if exact else f'{DOUBLE_TOLERANCE:g}'}"
        )
    return problems


def _build(
    target: Target, place: Path, compiler: Sequence[str], flags: Sequence[str], *, usage: bool
) -> list[str]:
    """Compile each generated C file separately and link them; return the command of the replay program."""
    usage_flags = ["-fstack-usage"] if usage else []
    compile_c([*compiler, *flags, *usage_flags, "-c", f"{target.name}.c", "-o", f"{target.name}.o"], place)
    name = target.name
    thermal = () if target.thermal is None else (f"{name}_thermal",)
    units = (name, f"{name}_tables", *thermal, "main")
    return _link(compiler, flags, place, units, "replay")


def _link(
    compiler: Sequence[str], flags: Sequence[str], place: Path, units: Sequence[str], program: str
) -> list[str]:
    """Compile the C files that have no object file yet, and link all; return the command of the program."""
    for unit in units:
        if not (place / f"{unit}.o").exists():
            compile_c([*compiler, *flags, "-c", f"{unit}.c", "-o", f"{unit}.o"], place)
    compile_c([*compiler, *(f"{unit}.o" for unit in units), "-o", str(place / program)], place)
    return [str(place / program)]


def compile_c(command: Sequence[str], place: Path) -> None:
    """Run a compiler command in a folder; raise CheckError with the first error message if it fails."""
    done = _run(command, place)
    if done.returncode != 0:
        raise CheckError(
            f"{shlex.join(command)} failed: {_first_error(done)}",
            place="verification",
            expected="compilation without a warning",
            remedy="Report this, or compile with another compiler (CC=...)",
        )


def _run(command: Sequence[str], place: Path) -> subprocess.CompletedProcess[str]:
    program_time_max_s = 300.0  # time limit for each call of the compiler or of the compiled program
    plain = {**os.environ, "LC_ALL": "C"}
    try:
        return subprocess.run(
            command,
            cwd=place,
            capture_output=True,
            text=True,
            check=False,
            env=plain,
            timeout=program_time_max_s,
        )
    except subprocess.TimeoutExpired as fault:
        raise CheckError(
            place="verification", found=f"{shlex.join(command)} took more than {program_time_max_s:g} s"
        ) from fault
    except OSError as fault:
        raise CheckError(
            place="verification", found=f"{command[0]} cannot be run: {fault.strerror}"
        ) from fault


def _first_error(done: subprocess.CompletedProcess[str]) -> str:
    lines = (done.stderr.strip() or done.stdout.strip() or "no message").splitlines()
    worst = [line for line in lines if "error" in line]
    return (worst or lines)[0].strip()


def _accepts_gcc_flags(compiler: Sequence[str]) -> bool:
    return bool(re.search(r"gcc|clang|free software foundation", _version_text(compiler), re.IGNORECASE))


def _version_text(compiler: Sequence[str]) -> str:
    with tempfile.TemporaryDirectory() as folder:
        return _run([*compiler, "--version"], Path(folder)).stdout


def _stack_of(place: Path) -> dict[str, int]:
    """Return the stack frame of each C function [bytes] from the compiler's files."""
    found: dict[str, int] = {}
    for path in place.glob("*.su"):
        for line in path.read_text(encoding="utf-8").splitlines():
            where, size, *_ = line.split("\t")
            found[where.rpartition(":")[2]] = int(size)
    return dict(sorted(found.items()))


def _sizes_of(target: Target, place: Path, compiler: Sequence[str]) -> dict[str, int]:
    """Return the sizes of tables, state and machine code [bytes].

    The size of the machine code is missing if this computer has no program ``size``.
    """
    probe = (
        f'#include <stdio.h>\n#include "{target.name}.h"\n'
        'int main(void) { printf("%lu", (unsigned long)sizeof(mrd_track_state)); return 0; }\n'
    )
    (place / "probe.c").write_text(probe, encoding="ascii")
    compile_c([*compiler, "probe.c", "-o", "probe"], place)
    sizes = {"tables": tables_bytes(target), "state": int(_run([str(place / "probe")], place).stdout)}
    if shutil.which("size"):
        listed = _run(["size", "-A", f"{target.name}.o"], place).stdout
        sections = re.findall(r"^(\.text\S*|\.rodata\S*)\s+(\d+)", listed, re.MULTILINE)
        sizes |= {"code": sum(int(size) for _, size in sections)}
    return sizes
