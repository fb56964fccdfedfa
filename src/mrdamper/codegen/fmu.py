"""A target as an FMU: co-simulation, FMI 2.0 or 3.0, with its sources and a binary for this machine.

The FMU compiles the C of ``c_code``, unchanged, and a wrapper of its own around it; each instance holds its
own parameters and state. The same target gives the same sources and the same token. Only sources that a
verification holds for become an FMU.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import platform
import subprocess
import tempfile
import uuid
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, get_args

from mrdamper import __version__
from mrdamper.codegen.c_code import banner, c_files, environment, sources_sha256
from mrdamper.codegen.model_description import build_description, description_of, model_description
from mrdamper.codegen.record import Verification
from mrdamper.codegen.target import Target
from mrdamper.codegen.variable import Variable
from mrdamper.codegen.variables import variables_of
from mrdamper.codegen.verify import FLAGS, find_compiler
from mrdamper.errors import CheckError, InputError
from mrdamper.files import is_folder

FmiVersion = Literal["2.0", "3.0"]
FMI_VERSIONS: tuple[FmiVersion, ...] = get_args(FmiVersion)

_PLATFORMS = {  # of this machine: folder of FMI 2.0, folder of FMI 3.0
    ("Linux", "x86_64"): ("linux64", "x86_64-linux"),
    ("Linux", "aarch64"): ("", "aarch64-linux"),
}
_LEFT_OUT = ("main.c", "CMakeLists.txt", "README.md", "misra.md")  # of the C folder: of no use in an FMU
_ENTRY = {"2.0": "fmi2.c", "3.0": "fmi3.c"}
_LARGEST_DOUBLE = 1.7976931348623157e308
_WHEN = (1980, 1, 1, 0, 0, 0)  # the zip's first day: the same FMU on every day
_COMPILE_s = 120.0


def write_fmu(
    target: Target, path: str | Path, *, version: FmiVersion = "3.0", verification: Verification
) -> None:
    """Write the FMU; the file appears whole or not at all.

    Parameters
    ----------
    version : of FMI: 2.0 or 3.0
    verification : that passed, of this very target

    Raises
    ------
    InputError
        A version that is not there, sources that are not verified, no C compiler, a place that cannot be
        written to.
    CheckError
        The compiler does not take the wrapper.
    """
    place = Path(path)
    if version not in FMI_VERSIONS:
        raise InputError(found=f"FMI version is {version!r}", expected=f"one of {', '.join(FMI_VERSIONS)}")
    if not is_folder(place.parent):
        raise InputError(
            place=place, found=f"cannot write: there is no folder {place.parent}; choose another folder"
        )
    _check_verified(target, verification)
    content = {name: text.encode("utf-8") for name, text in fmu_files(target, version=version).items()}
    record = json.dumps(verification.as_json(), indent=2) + "\n"
    content["documentation/verification.json"] = record.encode("utf-8")
    folder = _PLATFORMS.get((platform.system(), platform.machine()), ("", ""))[FMI_VERSIONS.index(version)]
    if folder:
        content[f"binaries/{folder}/{target.name}.so"] = _compiled(target, version, content)
    _write_zip(place, content)


def fmu_files(target: Target, *, version: FmiVersion) -> dict[str, str]:
    """Return every text file of the FMU but its record: path in the archive -> text."""
    variables = variables_of(target)
    blank = _texts(target, variables, version, token="")
    digest = hashlib.sha256("\0".join(f"{name}\0{text}" for name, text in sorted(blank.items())).encode())
    return _texts(target, variables, version, token=f"{{{uuid.UUID(bytes=digest.digest()[:16], version=5)}}}")


def _texts(
    target: Target, variables: Sequence[Variable], version: FmiVersion, *, token: str
) -> dict[str, str]:
    """Return the text files with a token in them."""
    context = _context(target, variables, version, token)

    def text(template: str) -> str:
        return environment().get_template(template).render(context)

    entry = _ENTRY[version]
    compiled = (entry, f"{target.name}_tables.c")
    sources = {
        name: each
        for name, each in c_files(target).items()
        if name not in _LEFT_OUT and not name.endswith(".csv")
    }
    sources |= {
        entry: text(f"fmu_{entry}.j2"),
        "fmu_instance.c": text("fmu_instance.c.j2"),
        "fmu_variables.h": text("fmu_variables.h.j2"),
    }
    if version == "3.0":
        sources["buildDescription.xml"] = build_description(target, compiled)
    return {
        "modelDescription.xml": model_description(
            target, variables, version=version, token=token, sources=compiled
        ),
        **{f"sources/{name}": each for name, each in sorted(sources.items())},
        "documentation/index.html": text("fmu_index.html.j2"),
    }


def _context(
    target: Target, variables: Sequence[Variable], version: FmiVersion, token: str
) -> dict[str, Any]:
    def number(value: float) -> str:
        finite = math.copysign(_LARGEST_DOUBLE, value) if math.isinf(value) else value
        return repr(float(finite))

    def access(variable: Variable) -> str:
        return {"input": "FMU_INPUT", "parameter": "FMU_PARAMETER"}.get(variable.causality, "FMU_READ_ONLY")

    names = {each.name for each in variables}
    return {
        "target": target,
        "name": target.name,
        "COMMAND": "VOLTAGE" if target.command_unit == "V" else "CURRENT",
        "banner": banner(target),
        "about": description_of(target),
        "variables": variables,
        "has": names.__contains__,
        "number": number,
        "access": access,
        "token": token,
        "fmi": version,
        "version": __version__,
    }


def _check_verified(target: Target, verification: Verification) -> None:
    """Refuse a record that did not pass, or that holds for other sources."""
    if not verification.passed:
        why = "; ".join(verification.problems) or "it did not pass"
        raise InputError(
            place=target.name,
            found=f"the C source is not verified ({why})",
            expected="a verification that passed",
            remedy="Export with verification",
        )
    found = sources_sha256(c_files(target))
    if verification.sources_sha256 != found:
        raise InputError(
            place=target.name,
            found=f"the verification holds for other sources ({verification.sources_sha256[:19]})",
            expected=found[:19],
            remedy="Verify this very target, with the same card, precision, step and name",
        )


def _compiled(target: Target, version: FmiVersion, content: Mapping[str, bytes]) -> bytes:
    """Return the shared library of this machine."""
    compiler = find_compiler()
    with tempfile.TemporaryDirectory(prefix="mrdamper-fmu-") as folder:
        for name, data in content.items():
            if name.startswith("sources/"):
                (Path(folder) / Path(name).name).write_bytes(data)
        command = [
            *compiler, *FLAGS, "-fPIC", "-shared", "-fvisibility=hidden", "-Wl,--build-id=none",
            _ENTRY[version], f"{target.name}_tables.c", "-o", f"{target.name}.so",
        ]  # fmt: skip
        try:
            done = subprocess.run(
                command, cwd=folder, capture_output=True, text=True, check=False, timeout=_COMPILE_s
            )
        except (OSError, subprocess.TimeoutExpired) as fault:
            raise CheckError(place="FMU", found=f"{compiler[0]} cannot be run: {fault}") from fault
        if done.returncode != 0:
            said = next((line for line in done.stderr.splitlines() if "error" in line), done.stderr.strip())
            raise CheckError(place="FMU", found=f"{' '.join(compiler)} does not take the sources: {said}")
        return (Path(folder) / f"{target.name}.so").read_bytes()


def _write_zip(place: Path, content: Mapping[str, bytes]) -> None:
    """Write the archive, the same bytes for the same content."""
    beside = place.with_name(f".{place.name}.{os.getpid()}.part")
    try:
        with zipfile.ZipFile(beside, "w") as archive:
            for name, data in content.items():
                entry = zipfile.ZipInfo(name, date_time=_WHEN)
                entry.create_system = 3  # its rights are Unix's
                entry.external_attr = (0o100755 if name.endswith(".so") else 0o100644) << 16
                archive.writestr(entry, data, zipfile.ZIP_DEFLATED, 9)
        beside.replace(place)
    except OSError as fault:
        beside.unlink(missing_ok=True)
        raise InputError(
            place=place, found=f"cannot write: {fault.strerror}; choose another folder"
        ) from fault
