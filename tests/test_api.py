"""Public names of the package have docstrings and units, and functions reject unknown keywords.

A name is public if neither it nor its module has a leading underscore.
"""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import pkgutil
import re
from collections.abc import Iterator
from types import ModuleType

import mrdamper

# Names of parameters that have a unit
QUANTITIES = {
    "amplitude", "acceleration", "command", "corner", "current", "damping", "displacement", "duration",
    "force", "gap", "largest", "least_gap", "least_thickness", "length", "longest_step", "mass", "period",
    "power", "size", "speed", "step", "stop_at", "temperature", "thickness", "time", "velocity", "width",
}  # fmt: skip
UNIT = re.compile(r"\[[^\]]+\]|\bin (?:N|m|s|K|degC|SI)\b")


def modules() -> Iterator[ModuleType]:
    for found in pkgutil.walk_packages(mrdamper.__path__, "mrdamper."):
        if not any(part.startswith("_") for part in found.name.split(".")):
            yield importlib.import_module(found.name)


def public() -> Iterator[tuple[str, object]]:
    """Generate each public function and class with its name, from the module that defines it."""
    for module in modules():
        for name, thing in vars(module).items():
            if (
                not name.startswith("_")
                and getattr(thing, "__module__", "") == module.__name__
                and (inspect.isfunction(thing) or inspect.isclass(thing))
            ):
                yield f"{module.__name__}.{name}", thing


PUBLIC = dict(public())


def functions() -> Iterator[tuple[str, inspect.Signature, str]]:
    """Generate all public functions and the public methods of public classes, with their signatures."""
    for name, thing in PUBLIC.items():
        if inspect.isfunction(thing):
            yield name, inspect.signature(thing), inspect.getdoc(thing) or ""
        elif isinstance(thing, type):
            for key, method in vars(thing).items():
                if inspect.isfunction(method) and not key.startswith("_"):
                    yield f"{name}.{key}", inspect.signature(method), inspect.getdoc(method) or ""


def test_every_public_name_has_docstring():
    silent = [
        name
        for name, thing in PUBLIC.items()
        if not inspect.getdoc(thing)
        or (dataclasses.is_dataclass(thing) and (thing.__doc__ or "").startswith(f"{thing.__name__}("))  # type: ignore[union-attr]
    ]
    assert silent == []


def test_public_parameters_with_quantity_have_unit():
    """The unit is in the name of the parameter (``rate_Hz``) or in brackets in the docstring."""
    bare = [
        f"{name}: {', '.join(found)}"
        for name, signature, said in functions()
        if name in PUBLIC
        and not UNIT.search(said)
        and (
            found := [
                each.name
                for each in signature.parameters.values()
                if each.name in QUANTITIES
                and re.search(r"\bfloat\b|FloatArray|ArrayLike", str(each.annotation))
            ]
        )
    ]
    assert bare == []


def test_public_functions_reject_unknown_keywords():
    """A misspelt option then causes an error instead of being ignored."""
    greedy = [
        name
        for name, signature, _ in functions()
        if any(each.kind is each.VAR_KEYWORD for each in signature.parameters.values())
    ]
    assert greedy == []
