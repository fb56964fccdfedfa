"""The model card: what identification hands on, as one JSON file that never carries code.

A card holds the damper (law, dependence of each coefficient, numbers with units and standard errors), its
operating envelope, how its data were prepared, the evidence (errors run by run), and a short excerpt of
one run on which it must reproduce its own stated error. docs/card.md describes the file key by key.

``card_schema`` reads, checks and writes the file.
"""

from __future__ import annotations

import statistics
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Annotated, Any

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.excitation import Trajectory
from mrdamper.models.damper import LAG, Damper, OperatingEnvelope
from mrdamper.models.force_band import ForceBand
from mrdamper.quantities import to_degC
from mrdamper.schema import Option, did_you_mean

Simulate = Callable[[Damper, Trajectory], FloatArray]

SPLITS = ("training", "held_out")
_SIGNALS = ("displacement_m", "velocity_m_s", "acceleration_m_s2", "command", "force_N")
_RUN_KEYS = ("name", "split", "rmse_N", "nrmse_percent")


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """Why a card may be believed: the errors of every run, and where its numbers come from.

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
        """Return the number of runs of a split and their median and worst ``nrmse_percent``."""
        found = [run["nrmse_percent"] for run in self.runs if run["split"] == split]
        return {
            "runs": len(found),
            "median_nrmse_percent": statistics.median(found) if found else None,
            "worst_nrmse_percent": max(found, default=None),
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Excerpt:
    """A short stretch of one training run, and the card's error on it when simulated from rest."""

    run: str
    step_s: Annotated[float, Option(least=0.0)]
    displacement_m: tuple[float, ...]
    velocity_m_s: tuple[float, ...]
    acceleration_m_s2: tuple[float, ...]
    command: tuple[float, ...]
    force_N: tuple[float, ...]
    rmse_N: Annotated[float, Option(least=0.0)]  # from sample `scored_from` on
    scored_from: int = 0
    dead_band_m: Annotated[float, Option(least=0.0)] = 0.0
    temperature_K: float | None = None  # of the whole excerpt

    def __post_init__(self) -> None:
        lengths = {name: len(getattr(self, name)) for name in _SIGNALS}
        if len(set(lengths.values())) != 1 or not 0 <= self.scored_from < len(self.force_N):
            raise InputError(
                place="excerpt",
                found=f"lengths are {lengths} and scored_from is {self.scored_from}",
                expected="equal lengths and one of the samples",
            )

    def trajectory(self) -> Trajectory:
        x, v, a, command = (np.array(getattr(self, name)) for name in _SIGNALS[:4])
        kelvin = None if self.temperature_K is None else np.full(len(x), self.temperature_K)
        return Trajectory(self.step_s, x, v, a, command, self.dead_band_m, kelvin)

    def error(self, damper: Damper, simulate: Simulate) -> float:
        """Return the RMS force error [N] of a damper on the excerpt."""
        residual = simulate(damper, self.trajectory()) - np.array(self.force_N)
        return float(np.sqrt(np.mean(residual[self.scored_from :] ** 2)))


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class ModelCard:
    """A damper with its evidence; its coefficients are on their limits where their forms would leave them.

    Inside the envelope the forms themselves must keep the limits.
    ``python_law`` is ``file.py:Class`` when the law is a user's own; ``force_band`` is what to expect of new
    runs (older cards have none); ``upgraded_from`` is the schema version
    of a file that carried no hash yet; ``file`` is where the card was read from, empty for one made here.
    """

    title: str
    damper: Damper
    envelope: OperatingEnvelope
    evidence: Evidence
    standard_errors: Mapping[str, float | None] = field(default_factory=dict)  # by flat number name
    preparation: Mapping[str, Any] = field(default_factory=dict)
    excerpt: Excerpt | None = None
    sources: tuple[str, ...] = ()
    notes: Mapping[str, Any] = field(default_factory=dict)
    python_law: str | None = None
    force_band: ForceBand | None = None
    upgraded_from: int | None = None
    file: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        parameters = (*self.damper.parameters, LAG)
        for name in self.standard_errors:
            if name not in parameters:
                raise InputError(
                    place="standard_errors", found=f"no parameter {name!r}; {did_you_mean(name, parameters)}"
                )
        if (self.damper.law.python is None) != (self.python_law is None):
            raise InputError(
                f"law {self.damper.law.name!r} and python_law {self.python_law!r} disagree",
                expected="both, or none of a user's own",
            )
        replace(self.damper, limited=False).check(self.envelope)
        # Outside the runs (between their commands, beyond their temperatures) a bound is still a bound.
        object.__setattr__(self, "damper", self.damper.on_limits())
        complete = {name: self.standard_errors.get(name) for name in parameters}
        object.__setattr__(self, "standard_errors", _freeze(complete, "standard_errors", ordered=True))
        object.__setattr__(self, "preparation", _freeze(self.preparation, "preparation"))
        object.__setattr__(self, "notes", _freeze(self.notes, "notes"))
        object.__setattr__(self, "sources", _freeze(tuple(self.sources), "sources"))
        _freeze(self.title, "title")

    def __repr__(self) -> str:
        """Return the card in a few lines: its law, its range and its errors."""
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
        if self.upgraded_from is not None:
            lines.append(f"  upgraded from schema version {self.upgraded_from}, which carried no hash")
        return "\n".join(lines)


def cut_excerpt(
    damper: Damper,
    trajectory: Trajectory,
    force: FloatArray,
    simulate: Simulate,
    *,
    run: str,
    samples: slice,
    scored_from: int = 0,
) -> Excerpt:
    """Return a stretch of a run with the damper's error on it, numbers rounded to nine digits.

    A temperature that varies over the stretch is replaced by its mean there. ``force`` is the measured one
    [N]. Pass the simulation by which the card will be verified.
    """
    t = trajectory
    columns = (t.displacement, t.velocity, t.acceleration, t.command, force)
    rounded = {
        name: tuple(float(f"{value:.9g}") for value in column[samples])
        for name, column in zip(_SIGNALS, columns, strict=True)
    }
    kelvin = None if t.temperature is None else float(f"{float(np.mean(t.temperature[samples])):.9g}")
    unscored = Excerpt(
        run=run,
        step_s=float(t.step),
        rmse_N=0.0,
        scored_from=scored_from,
        dead_band_m=float(t.dead_band),
        temperature_K=kelvin,
        **rounded,
    )
    return replace(unscored, rmse_N=unscored.error(damper, simulate))


def verify_excerpt(card: ModelCard, simulate: Simulate) -> float:
    """Return the re-simulated error [N] on the card's excerpt.

    Raises
    ------
    InputError
        No excerpt, or an error that differs from the stated one by more than 1e-4 of the peak force.
    """
    if card.excerpt is None:
        raise InputError(
            "carries no excerpt to verify", place=f"card {card.title!r}", remedy="identify again to have one"
        )
    found = card.excerpt.error(card.damper, simulate)
    allowed = 1e-4 * max(map(abs, card.excerpt.force_N))
    if not abs(found - card.excerpt.rmse_N) <= allowed:
        raise InputError(
            place=f"card {card.title!r}",
            found=(
                f"its error on the excerpt of {card.excerpt.run} is {found:.6g} N, and it states "
                f"{card.excerpt.rmse_N:.6g} N; its numbers were changed, or the simulation was"
            ),
        )
    return found


def _problem_of_run(run: Mapping[str, Any]) -> str:
    """Return the fault of a run's row in the evidence; empty where there is none."""
    lacking = [key for key in _RUN_KEYS if key not in run]
    if lacking:
        return f"no {', '.join(lacking)}; expected {', '.join(_RUN_KEYS)}"
    if not isinstance(run["name"], str) or run["split"] not in SPLITS:
        found = f"name is {run['name']!r} and split is {run['split']!r}"
        return f"{found}; expected a text, and one of {', '.join(SPLITS)}"
    for key in ("rmse_N", "nrmse_percent"):
        if not _is_finite(run[key]) or run[key] < 0.0:
            return f"{key} is {run[key]!r}; expected a finite number, at least 0"
    return ""


def _is_finite(value: object) -> bool:
    """Return whether the value is a JSON number that a float can hold."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= sys.float_info.max


def _require_unicode(text: str, place: str) -> None:
    """Refuse half of a character (a lone surrogate), which no file in UTF-8 can hold."""
    try:
        text.encode("utf-8")
    except UnicodeEncodeError as fault:
        raise InputError(
            place=place, found=f"character {fault.start} is {text[fault.start]!r}", expected="Unicode text"
        ) from fault


def _freeze(value: Any, place: str, *, ordered: bool = False) -> Any:  # noqa: ANN401 - whatever JSON holds
    """Return a read-only copy, tables in alphabetical order; refuse what JSON cannot hold."""
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
    if value is None or isinstance(value, str | bool) or _is_finite(value):
        return value
    raise InputError(
        found=f"{place} is {value!r}", expected="what JSON holds: text, finite numbers, lists, tables"
    )
