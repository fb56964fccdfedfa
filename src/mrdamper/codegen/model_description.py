"""The XML of an FMU: what a master reads before it loads anything.

Written from the list of ``variables``, from which the C is written too. Co-simulation of FMI 2.0 and 3.0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from xml.etree import ElementTree as Tree

from mrdamper import __version__
from mrdamper.codegen.target import Target
from mrdamper.codegen.variable import UNITS, Variable

_LOGGED = {
    "logStatusDiscard": "a value that was refused; the old one is kept",
    "logStatusError": "a call that was refused",
    "logAll": "everything",
}
_TYPES = {"real": "Float64", "integer": "Int32", "boolean": "Boolean"}
_NOTHING = ""  # dependencies: on no input; outputs change in a step only, so there is no direct feed-through


def description_of(target: Target) -> str:
    """Return one line that says what the FMU is."""
    what = {
        "model": f"Magnetorheological damper ({target.law})",
        "controller": f"Force controller of a magnetorheological damper ({target.law})",
        "both": f"Magnetorheological damper ({target.law}) with its force controller",
    }[target.content]
    kind = "" if target.controller is None else f", controller {target.controller.name}"
    return f"{what}{kind}; card {target.fingerprint}; {target.precision} arithmetic"


def model_description(
    target: Target, variables: Sequence[Variable], *, version: str, token: str, sources: Sequence[str]
) -> str:
    """Return modelDescription.xml; ``sources`` are the files to compile (2.0 names them here)."""
    return (_fmi2 if version == "2.0" else _fmi3)(target, variables, token, sources)


def build_description(target: Target, sources: Sequence[str]) -> str:
    """Return sources/buildDescription.xml of FMI 3.0."""
    root = Tree.Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    build = _add(root, "BuildConfiguration", {"modelIdentifier": target.name})
    options = "-std=c99 -O2 -ffp-contract=off"
    files = _add(build, "SourceFileSet", {"language": "C99", "compiler": "gcc", "compilerOptions": options})
    for name in sources:
        _add(files, "SourceFile", {"name": name})
    return _text(root)


def _fmi2(target: Target, variables: Sequence[Variable], token: str, sources: Sequence[str]) -> str:
    about = {"fmiVersion": "2.0", **_about(target), "guid": token, "numberOfEventIndicators": "0"}
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
        "canSerializeFMUstate": "true",
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
                _add(unknowns, "Unknown", {"index": str(index), "dependencies": _NOTHING})
    return _text(root)


def _fmi3(target: Target, variables: Sequence[Variable], token: str, sources: Sequence[str]) -> str:
    del sources  # FMI 3.0 names them in buildDescription.xml
    root = Tree.Element(
        "fmiModelDescription", {"fmiVersion": "3.0", **_about(target), "instantiationToken": token}
    )
    can = {
        "modelIdentifier": target.name,
        "needsExecutionTool": "false",
        "canBeInstantiatedOnlyOncePerProcess": "false",
        "canGetAndSetFMUState": "true",
        "canSerializeFMUState": "true",
        "canHandleVariableCommunicationStepSize": "false",
        "fixedInternalStepSize": _number(target.period_s),
        "maxOutputDerivativeOrder": "0",
        "hasEventMode": "false",
    }
    _add(root, "CoSimulation", can)
    _add_surroundings(root, target, variables)
    listed = _add(root, "ModelVariables")
    for reference, each in enumerate(variables):
        _add(listed, _TYPES[each.kind], {**_heading(each, reference), **_initial(each), **_values(each)})
    structure = _add(root, "ModelStructure")
    for group in ("Output", "InitialUnknown"):
        for reference, each in enumerate(variables):
            if each.causality == "output":
                _add(structure, group, {"valueReference": str(reference), "dependencies": _NOTHING})
    return _text(root)


def _about(target: Target) -> dict[str, str]:
    return {
        "modelName": target.name,
        "description": description_of(target),
        "version": __version__,
        "generationTool": f"mrdamper {__version__}",
        "variableNamingConvention": "flat",
    }


def _add(parent: Tree.Element, tag: str, attributes: dict[str, str] | None = None) -> Tree.Element:
    return Tree.SubElement(parent, tag, attributes or {})


def _add_surroundings(root: Tree.Element, target: Target, variables: Sequence[Variable]) -> None:
    """Add units, log categories and the default experiment."""
    units = _add(root, "UnitDefinitions")
    for name in dict.fromkeys(each.unit for each in variables if each.unit):
        unit = UNITS[name]
        defined = _add(units, "Unit", {"name": name})
        _add(defined, "BaseUnit", {of: str(power) for of, power in unit.base.items()})
        if unit.display:
            shown = {"name": unit.display, "factor": _number(unit.factor), "offset": _number(unit.offset)}
            _add(defined, "DisplayUnit", shown)
    categories = _add(root, "LogCategories")
    for name, said in _LOGGED.items():
        _add(categories, "Category", {"name": name, "description": said})
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
    """Return what stands at a variable's type: unit, range, start."""
    found = {}
    if variable.unit and variable.kind == "real":
        found["unit"] = variable.unit
        if UNITS[variable.unit].display:
            found["displayUnit"] = UNITS[variable.unit].display
    if variable.kind == "real":
        bounds = (("min", variable.low), ("max", variable.high))
        found |= {name: _number(value) for name, value in bounds if math.isfinite(value)}
    if variable.start is not None:
        said = {"boolean": "true" if variable.start else "false", "integer": f"{variable.start:.0f}"}
        found["start"] = said.get(variable.kind) or _number(variable.start)
    return found


def _number(value: float) -> str:
    """Return the shortest decimal that reads back as the same double."""
    return repr(float(value))


def _text(root: Tree.Element) -> str:
    Tree.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{Tree.tostring(root, encoding="unicode")}\n'
