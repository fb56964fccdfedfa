"""The model card: the result of an identification as one JSON file without code.

A card contains the damper model: hysteresis law, coefficients as functions of command and temperature, and
parameters with units and standard errors. It also contains the operating envelope (range of the data), the
preparation of the data, and the errors of each run. docs/card.md describes the file key by key.
``card_schema`` reads, checks and writes the file.
"""

from __future__ import annotations

import statistics
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

import mrdamper
from mrdamper.errors import InputError
from mrdamper.models.damper import LAG, Damper, OperatingEnvelope
from mrdamper.models.force_band import ForceBand
from mrdamper.quantities import to_degC
from mrdamper.results import Picture, load
from mrdamper.schema import unknown_name

SPLITS = ("training", "held_out")
_RUN_KEYS = ("name", "split", "rmse_N", "nrmse_percent")


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """Evidence for the parameters of a card: errors of every run, method of the fit, and data.

    Each run has at least ``name``, ``split`` ("training" or "held_out"), ``rmse_N`` and ``nrmse_percent``.
    """

    runs: tuple[Mapping[str, Any], ...]
    method: str
    cost: float
    dataset_fingerprint: str
    seed: int | None = None
    versions: Mapping[str, str] = field(default_factory=dict)
    converged: bool = True

    def __post_init__(self) -> None:
        for name in ("runs", "versions"):
            object.__setattr__(self, name, _freeze(getattr(self, name), f"evidence.{name}"))
        object.__setattr__(self, "cost", float(self.cost))
        for k, run in enumerate(self.runs):
            problem = _problem_of_run(run)
            if problem:
                raise InputError(place=f"evidence.runs[{k}]", found=problem)

    def errors(self, split: str) -> dict[str, float | int | None]:
        """Return number, median and worst ``nrmse_percent`` of the training runs or of the held-out runs."""
        found = [run["nrmse_percent"] for run in self.runs if run["split"] == split]
        return {
            "runs": len(found),
            "median_nrmse_percent": statistics.median(found) if found else None,
            "worst_nrmse_percent": max(found, default=None),
        }


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class ModelCard(Picture):
    """A damper model and the evidence for it: runs, errors, identification method.

    The hysteresis law sets limits for its coefficients. Inside the operating envelope, coefficients beyond
    these limits are an error. Outside the envelope, coefficients are clipped to the limits. ``python_law`` is
    ``file.py:Class`` if the hysteresis law is user-defined. ``force_band`` is the expected error of new runs,
    or None if it was not estimated. ``file`` is the path of the card, or empty if the card was not read from
    a file.
    """

    _picture = "mrdamper.report.figures.characteristics:card_figure"
    title: str
    damper: Damper
    envelope: OperatingEnvelope
    evidence: Evidence
    # The keys are names of parameters such as yield_force.gain.
    standard_errors: Mapping[str, float | None] = field(default_factory=dict)
    preparation: Mapping[str, Any] = field(default_factory=dict)
    sources: tuple[str, ...] = ()
    notes: Mapping[str, Any] = field(default_factory=dict)
    python_law: str | None = None
    force_band: ForceBand | None = None
    file: str = field(default="", compare=False)

    # Every function whose first parameter is a card is also a method of the card.
    evaluate = mrdamper.evaluate
    simulate = mrdamper.simulate
    compare = mrdamper.compare
    heat = mrdamper.heat
    derate = mrdamper.derate
    heatsink = mrdamper.heatsink
    track = mrdamper.track
    export = mrdamper.export

    def __post_init__(self) -> None:
        parameters = (*self.damper.parameters, LAG)
        for name in self.standard_errors:
            if name not in parameters:
                raise unknown_name(f"no parameter {name!r}", name, parameters, "standard_errors")
        if (self.damper.law.python is None) != (self.python_law is None):
            raise InputError(
                f"law {self.damper.law.name!r} and python_law {self.python_law!r} disagree",
                expected="both, or none for a law of the kernel",
            )
        replace(self.damper, limited=False).check(self.envelope)
        # Outside the envelope, a coefficient can exceed its limits.
        object.__setattr__(self, "damper", self.damper.on_limits())
        complete = {name: self.standard_errors.get(name) for name in parameters}
        object.__setattr__(self, "standard_errors", _freeze(complete, "standard_errors", ordered=True))
        object.__setattr__(self, "preparation", _freeze(self.preparation, "preparation"))
        object.__setattr__(self, "notes", _freeze(self.notes, "notes"))
        object.__setattr__(self, "sources", _freeze(tuple(self.sources), "sources"))
        _freeze(self.title, "title")

    def __repr__(self) -> str:
        """Return a description in a few lines: hysteresis law, range and errors."""
        damper, envelope = self.damper, self.envelope
        (low, high), (in_, out), speed = (
            envelope.command,
            envelope.displacement,
            max(map(abs, envelope.velocity)),
        )
        reach = f"{low:.3g} to {high:.3g} {damper.command_unit}, {1e3 * in_:.3g} to {1e3 * out:.3g} mm, "
        reach += f"up to {1e3 * speed:.3g} mm/s"
        if envelope.temperature is not None:
            reach += ", {:.3g} to {:.3g} degC".format(*map(to_degC, envelope.temperature))
        lines = [
            f"ModelCard {self.title!r}",
            f"  law {damper.law.name}, {len(damper.parameters)} parameters",
            f"  identified on {reach}",
        ]
        for split, found in ((split, self.evidence.errors(split)) for split in SPLITS):
            if found["runs"]:
                lines.append(
                    f"  {split.replace('_', ' ')}: {found['runs']} runs, error "
                    f"{found['median_nrmse_percent']:.2f} % median, "
                    f"{found['worst_nrmse_percent']:.2f} % worst"
                )
        return "\n".join(lines)

    def summary(self) -> str:
        """Return the hysteresis law, the range and the errors, each in its own line."""
        return repr(self)

    def save(self, path: str | Path) -> Path:
        """Write the card as JSON. If writing fails, no incomplete file remains."""
        load("mrdamper.models.card_schema:write_card")(self, path)
        return Path(path)


def _problem_of_run(run: Mapping[str, Any]) -> str:
    """Return the error in a run's evidence as text; empty if there is no error."""
    lacking = [key for key in _RUN_KEYS if key not in run]
    if lacking:
        return f"no {', '.join(lacking)}; expected {', '.join(_RUN_KEYS)}"
    if not isinstance(run["name"], str) or run["split"] not in SPLITS:
        found = f"name is {run['name']!r} and split is {run['split']!r}"
        return f"{found}; expected a text, and one of {', '.join(SPLITS)}"
    for key in ("rmse_N", "nrmse_percent"):
        if not _is_finite_number(run[key]) or run[key] < 0.0:
            return f"{key} is {run[key]!r}; expected a finite number, at least 0"
    return ""


def _is_finite_number(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= sys.float_info.max


def _require_unicode(text: str, place: str) -> None:
    """Raise InputError if a text has a lone surrogate character, which UTF-8 cannot store."""
    try:
        text.encode("utf-8")
    except UnicodeEncodeError as fault:
        raise InputError(
            place=place, found=f"character {fault.start} is {text[fault.start]!r}", expected="Unicode text"
        ) from fault


def _freeze(value: Any, place: str, *, ordered: bool = False) -> Any:  # noqa: ANN401 - any JSON value
    """Return a read-only copy of a JSON value, with sorted keys unless ``ordered``.

    Raise InputError if the value is not JSON.
    """
    if isinstance(value, Mapping):
        keys = list(value) if ordered else sorted(value, key=str)
        if not all(isinstance(key, str) for key in keys):
            raise InputError(place=place, found=f"keys are {keys}", expected="text")
        return MappingProxyType({key: _freeze(value[key], f"{place}.{key}") for key in keys})
    if isinstance(value, list | tuple):
        return tuple(_freeze(each, f"{place}[{k}]") for k, each in enumerate(value))
    if isinstance(value, np.generic | np.ndarray):
        return _freeze(value.tolist(), place)
    if isinstance(value, str):
        _require_unicode(value, place)
    if value is None or isinstance(value, str | bool) or _is_finite_number(value):
        return value
    raise InputError(
        found=f"{place} is {value!r}", expected="JSON values: text, finite numbers, lists, tables"
    )
