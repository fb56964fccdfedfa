"""Write an FMU for co-simulation (FMI 2.0), with C sources and a compiled library.

The FMU contains the unchanged C files of ``c_code``, and the file ``fmi2.c``, which includes them. The FMU
can be instantiated several times, because each instance has its own parameters and state. The same export
options and model card give the same sources and the same GUID (*token*). An FMU is written only if its
sources passed the verification.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import platform
import tempfile
import uuid
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as Tree

from mrdamper import __version__
from mrdamper.codegen.c_code import banner, c_files, environment, sources_sha256
from mrdamper.codegen.record import Verification
from mrdamper.codegen.target import Target
from mrdamper.codegen.variables import UNITS, Variable, variables_of
from mrdamper.codegen.verify import FLAGS, compile_c, find_compiler
from mrdamper.errors import InputError
from mrdamper.files import is_folder

_BINARY_FOLDERS = {("Linux", "x86_64"): "linux64"}  # folder names of FMI 2.0, by operating system and machine
_NOT_IN_FMU = ("main.c", "CMakeLists.txt", "README.md", "misra.md")
_ENTRY = "fmi2.c"
_LOGGED = {
    "logStatusDiscard": "a value out of range; the old one is kept",
    "logStatusError": "a call that failed",
    "logAll": "everything",
}
_NO_DEPENDENCIES = ""  # Inputs act in the next time step, so that no output depends directly on an input.


def write_fmu(target: Target, path: str | Path, *, verification: Verification) -> None:
    """Write an exported card (target) as FMU: either the complete file or no file.

    Parameters
    ----------
    verification : record of the passed verification of this target

    Raises
    ------
    InputError
        If the sources are not verified, there is no C compiler, or the path cannot be written.
    CheckError
        If the compiler rejects the wrapper.
    """
    place = Path(path)
    if not is_folder(place.parent):
        raise InputError(
            place=place, found=f"cannot write: there is no folder {place.parent}; choose another folder"
        )
    _check_verification(target, verification)
    content = {name: text.encode("utf-8") for name, text in fmu_files(target).items()}
    record = json.dumps(verification.as_json(), indent=2) + "\n"
    content["documentation/verification.json"] = record.encode("utf-8")
    folder = _BINARY_FOLDERS.get((platform.system(), platform.machine()))
    if folder is not None:
        content[f"binaries/{folder}/{target.name}.so"] = _compile(target, content)
    _write_zip(place, content)


def fmu_files(target: Target) -> dict[str, str]:
    """Return the text files of the FMU by path in the archive, without the record of the verification."""
    variables = variables_of(target)
    blank = _texts(target, variables, token="")
    digest = hashlib.sha256("\0".join(f"{name}\0{text}" for name, text in sorted(blank.items())).encode())
    return _texts(target, variables, token=f"{{{uuid.UUID(bytes=digest.digest()[:16], version=5)}}}")


def _texts(target: Target, variables: Sequence[Variable], *, token: str) -> dict[str, str]:
    """Return the text files of an FMU that has the given token (GUID)."""
    sources = {
        name: content
        for name, content in c_files(target).items()
        if name not in _NOT_IN_FMU and not name.endswith(".csv")
    }
    sources[_ENTRY] = environment().get_template("fmi2.c.j2").render(_context(target, variables, token))
    return {
        "modelDescription.xml": model_description(
            target, variables, token=token, sources=(_ENTRY, f"{target.name}_tables.c")
        ),
        **{f"sources/{name}": content for name, content in sorted(sources.items())},
    }


def _context(target: Target, variables: Sequence[Variable], token: str) -> dict[str, Any]:
    # The inputs are known only at the beginning of a communication step. During the step, the motion is
    # extrapolated by a parabola. For the longest permitted step, the RMS error of the force is 0.1 % for a
    # motion at 1 Hz, and 6 % at 5 Hz.
    step_max_s = 10e-3
    largest_double = 1.7976931348623157e308

    def number(value: float) -> str:
        finite = math.copysign(largest_double, value) if math.isinf(value) else value
        return repr(float(finite))

    def access(variable: Variable) -> str:
        return {"input": "FMU_INPUT", "parameter": "FMU_PARAMETER"}.get(variable.causality, "FMU_READ_ONLY")

    names = {each.name for each in variables}
    return {
        "target": target,
        "name": target.name,
        "COMMAND": "VOLTAGE" if target.command_unit == "V" else "CURRENT",
        "banner": banner(target),
        "variables": variables,
        "has": names.__contains__,
        "number": number,
        "access": access,
        "token": token,
        "step_max_s": max(step_max_s, target.period_s),
    }


def _check_verification(target: Target, verification: Verification) -> None:
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
            found=f"the verification is of other sources ({verification.sources_sha256[:19]})",
            expected=found[:19],
            remedy="Verify this very target, with the same card, precision, step and name",
        )


def _compile(target: Target, content: Mapping[str, bytes]) -> bytes:
    """Compile the sources of an FMU; return the content of the shared library for this machine."""
    compiler = find_compiler()
    with tempfile.TemporaryDirectory(prefix="mrdamper-fmu-") as folder:
        for name, data in content.items():
            if name.startswith("sources/"):
                (Path(folder) / Path(name).name).write_bytes(data)
        command = [
            *compiler, *FLAGS, "-fPIC", "-shared", "-fvisibility=hidden", "-Wl,--build-id=none",
            _ENTRY, f"{target.name}_tables.c", "-o", f"{target.name}.so",
        ]  # fmt: skip
        compile_c(command, Path(folder))
        return (Path(folder) / f"{target.name}.so").read_bytes()


def _write_zip(place: Path, content: Mapping[str, bytes]) -> None:
    """Write a ZIP archive atomically. The same content always gives the same bytes."""
    zip_date = (1980, 1, 1, 0, 0, 0)  # A constant date makes archives with equal content equal.
    beside = place.with_name(f".{place.name}.{os.getpid()}.part")
    try:
        with zipfile.ZipFile(beside, "w") as archive:
            for name, data in content.items():
                entry = zipfile.ZipInfo(name, date_time=zip_date)
                entry.create_system = 3  # Unix, so that the file modes below are valid
                entry.external_attr = (0o100755 if name.endswith(".so") else 0o100644) << 16
                archive.writestr(entry, data, zipfile.ZIP_DEFLATED, 9)
        beside.replace(place)
    except OSError as fault:
        beside.unlink(missing_ok=True)
        raise InputError(
            place=place, found=f"cannot write: {fault.strerror}; choose another folder"
        ) from fault


def description_of(target: Target) -> str:
    """Return a one-line description of the FMU."""
    what = {
        "model": f"Magnetorheological damper ({target.law})",
        "controller": f"Force controller of a magnetorheological damper ({target.law})",
        "both": f"Magnetorheological damper ({target.law}) with its force controller",
    }[target.content]
    kind = "" if target.controller is None else f", controller {target.controller.name}"
    return f"{what}{kind}; card {target.fingerprint}; {target.precision} arithmetic"


def model_description(
    target: Target, variables: Sequence[Variable], *, token: str, sources: Sequence[str]
) -> str:
    """Return modelDescription.xml, with the names ``sources`` of the C files to compile."""
    about = {
        "fmiVersion": "2.0",
        "modelName": target.name,
        "description": description_of(target),
        "version": __version__,
        "generationTool": f"mrdamper {__version__}",
        "variableNamingConvention": "flat",
        "guid": token,
        "numberOfEventIndicators": "0",
    }
    root = Tree.Element("fmiModelDescription", about)
    can = {
        "modelIdentifier": target.name,
        "canHandleVariableCommunicationStepSize": "false",
        "canInterpolateInputs": "false",
        "maxOutputDerivativeOrder": "0",
        "canRunAsynchronuously": "false",
        "canBeInstantiatedOnlyOncePerProcess": "false",
        "canNotUseMemoryManagementFunctions": "true",
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "false",
        "providesDirectionalDerivative": "false",
    }
    files = _add(_add(root, "CoSimulation", can), "SourceFiles")
    for name in sources:
        _add(files, "File", {"name": name})
    _add_surroundings(root, target, variables)
    listed = _add(root, "ModelVariables")
    for reference, each in enumerate(variables):
        scalar = _add(listed, "ScalarVariable", {**_heading(each, reference), **_initial(each)})
        _add(scalar, each.kind.capitalize(), _values(each))
    structure = _add(root, "ModelStructure")
    for group in ("Outputs", "InitialUnknowns"):
        unknowns = _add(structure, group)
        for index, each in enumerate(variables, start=1):
            if each.causality == "output":
                _add(unknowns, "Unknown", {"index": str(index), "dependencies": _NO_DEPENDENCIES})
    return _text(root)


def _add(parent: Tree.Element, tag: str, attributes: dict[str, str] | None = None) -> Tree.Element:
    return Tree.SubElement(parent, tag, attributes or {})


def _add_surroundings(root: Tree.Element, target: Target, variables: Sequence[Variable]) -> None:
    units = _add(root, "UnitDefinitions")
    for name in dict.fromkeys(each.unit for each in variables if each.unit):
        unit = UNITS[name]
        defined = _add(units, "Unit", {"name": name})
        _add(defined, "BaseUnit", {of: str(power) for of, power in unit.base.items()})
        if unit.display:
            shown = {"name": unit.display, "factor": _number(unit.factor), "offset": _number(unit.offset)}
            _add(defined, "DisplayUnit", shown)
    categories = _add(root, "LogCategories")
    for name, description in _LOGGED.items():
        _add(categories, "Category", {"name": name, "description": description})
    experiment = {"startTime": "0", "stopTime": "10", "stepSize": _number(target.period_s)}
    _add(root, "DefaultExperiment", experiment)


def _heading(variable: Variable, reference: int) -> dict[str, str]:
    return {
        "name": variable.name,
        "valueReference": str(reference),
        "description": variable.description,
        "causality": variable.causality,
        "variability": variable.variability,
    }


def _initial(variable: Variable) -> dict[str, str]:
    if variable.causality in {"input", "independent"}:
        return {}
    return {"initial": "calculated" if variable.start is None else "exact"}


def _values(variable: Variable) -> dict[str, str]:
    values: dict[str, str] = {}
    if variable.kind == "real":
        if variable.unit:
            units = {"unit": variable.unit, "displayUnit": UNITS[variable.unit].display}
            values |= {name: unit for name, unit in units.items() if unit}
        bounds = (("min", variable.low), ("max", variable.high))
        values |= {name: _number(value) for name, value in bounds if math.isfinite(value)}
    if variable.start is not None:
        texts = {"boolean": "true" if variable.start else "false", "integer": f"{variable.start:.0f}"}
        values |= {"start": texts.get(variable.kind) or _number(variable.start)}
    return values


def _number(value: float) -> str:
    """Return the shortest decimal text that a parser converts to exactly this double."""
    return repr(float(value))


def _text(root: Tree.Element) -> str:
    Tree.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{Tree.tostring(root, encoding="unicode")}\n'
