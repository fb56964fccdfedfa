"""Write modelDescription.xml of an FMU (FMI 2.0), which a simulator reads before it loads the binary.

This file and the C code are generated from the same list of ``variables``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from xml.etree import ElementTree as Tree

from mrdamper import __version__
from mrdamper.codegen.target import Target
from mrdamper.codegen.variable import UNITS, Variable

_LOGGED = {
    "logStatusDiscard": "a value out of range; the old one is kept",
    "logStatusError": "a call that failed",
    "logAll": "everything",
}
_NO_DEPENDENCIES = ""  # Outputs change only in a time step. Therefore no output depends directly on an input.


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
    """Return the text of modelDescription.xml. A simulator has to compile the C files ``sources``."""
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
    """Add the XML elements for units, log categories and the default experiment."""
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
    """Return unit, range and start value of a variable as XML attributes."""
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
