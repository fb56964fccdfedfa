"""What the jobs answer: values as JSON takes them, every error with its unit in its key."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from mrdamper.identify.predict import finite, row
from mrdamper.identify.scores import RunError, summary
from mrdamper.schema import Json

if TYPE_CHECKING:  # scores are told without loading what fits
    from mrdamper.identify.assess import Assessment, CrossValidated, LawScore
    from mrdamper.identify.fit import Identification
    from mrdamper.identify.problem import Estimate

__all__ = ["Json", "by_temperature", "identification", "line", "summaries"]


def identification(fitted: Identification, judged: Assessment, out: Path, table: Sequence[LawScore]) -> Json:
    """Return what ``mrdamper identify --json`` prints."""
    result = fitted.result
    return {
        "law": fitted.damper.law.name,
        "method": result.method,
        "coefficients": {estimate.name: _estimate(estimate) for estimate in result.estimates},
        "cpu_s": round(fitted.cpu_s, 4),
        "card": str(out / "card.json"),
        "report": str(out / "report.html"),
        "runs": [row(error) for error in judged.runs],
        "summary": summaries(judged.runs),
        "cost_percent": result.cost_percent,
        "seed": result.seed,
        "starts": [
            {
                "index": s.index,
                "cost_percent": finite(s.cost_percent),
                "evaluations": s.evaluations,
                "converged": s.converged,
            }
            for s in result.starts
        ],
        "session_offsets_N": dict(result.offsets_N),
        "passivity_min": finite(judged.passivity_min),
        "cancelled": result.cancelled,
        "notes": [*result.notes, *judged.words],
        "by_temperature": by_temperature(judged.runs),
        "actuation": _actuation(fitted),
        "assumed": list(fitted.damper.assumed),
        "identifiability": _identifiability(judged),
        "left_out": [_left(left) for left in judged.left_out],
        "left_out_summary": _left_summaries(judged.left_out),
        "law_table": [
            {
                "law": score.law,
                "numbers": score.free_parameters,
                "training_median_percent": finite(score.training_median),
                "held_out_median_percent": finite(score.held_out_median),
                "held_out_worst_percent": finite(score.held_out_worst),
                "cpu_s": round(score.cpu_s, 3),
            }
            for score in table
        ],
    }


def by_temperature(errors: Iterable[RunError]) -> list[Json]:
    """Return the RMS error [N] over the runs of each motion, temperature (to 1 degC) and split."""
    groups: dict[tuple[str, int, str], list[float]] = {}
    for error in errors:
        if error.temperature_degC is not None:
            key = (error.motion, round(error.temperature_degC), error.split)
            groups.setdefault(key, []).append(error.rmse_N**2)
    return [
        {
            "motion": motion,
            "temperature_degC": degrees,
            "split": split,
            "runs": len(squares),
            "rmse_N": math.sqrt(sum(squares) / len(squares)),
        }
        for (motion, degrees, split), squares in sorted(groups.items())
    ]


def _actuation(fitted: Identification) -> Json | None:
    found = fitted.actuation
    if found is None:
        return None
    errors = {f"{name}_standard_error": finite(error) for name, error in found.standard_errors.items()}
    told: Json = {**asdict(found.actuation), **errors}
    return {
        **told,
        "t63_s": found.t63_s,
        "t90_s": found.t90_s,
        "rmse_N": found.rmse_N,
        "unlagged_rmse_N": found.unlagged_rmse_N,
        "windows": found.windows,
    }


def _identifiability(judged: Assessment) -> Json | None:
    """Return what the data cannot tell apart, with the profile and the bootstrap where they were made."""
    from mrdamper.identify.confidence.sentences import sentence

    direction, profile, bootstrap = judged.direction, judged.profile, judged.bootstrap
    if direction is None:
        return None
    told: Json = {
        "worst_direction": dict(zip(direction.names, map(float, direction.weights), strict=True)),
        "standard_error_percent": finite(direction.standard_error_percent),
        "condition": finite(direction.condition),
        "sentence": sentence(direction),
    }
    if profile is not None:
        told["profile"] = {
            "name": profile.name,
            "values": [float(value) for value in profile.values],
            "cost_percent": [finite(cost) for cost in profile.costs_percent],
            "interval": [finite(end) for end in profile.interval],
            "ends": list(profile.ends),
        }
    if bootstrap is not None:
        told["bootstrap"] = {
            "draws": bootstrap.draws,
            "failed": bootstrap.failed,
            "standard_deviation": {n: finite(v) for n, v in bootstrap.standard_deviation.items()},
            "percentiles_5_95": {n: [finite(x) for x in v] for n, v in bootstrap.percentiles.items()},
        }
    return told


def _estimate(estimate: Estimate) -> Json:
    return {
        "value": estimate.value,
        "unit": estimate.unit,
        "standard_error": finite(estimate.standard_error),
        "design_error_percent": finite(estimate.design_error_percent),
        "identifiable": bool(estimate.identifiable),
        "at_bound": estimate.at_bound or None,
        "lower": finite(estimate.lower),
        "upper": finite(estimate.upper),
    }


def summaries(errors: Iterable[RunError]) -> Json:
    """Return median and worst of ``nrmse_percent`` by split."""
    errors = tuple(errors)
    return {
        split: _in_percent(summary(e for e in errors if e.split == split))
        for split in ("training", "held_out")
        if any(e.split == split for e in errors)
    }


def _in_percent(values: Mapping[str, float]) -> Json:
    return {f"{name}_nrmse_percent": finite(value) for name, value in values.items()}


def _left(left: CrossValidated) -> Json:
    errors = [{**row(error), "split": "held_out"} for error in left.errors]
    return {"kind": left.kind, "left_out": left.left_out, **_in_percent(summary(left.errors)), "runs": errors}


def _left_summaries(left_out: Sequence[CrossValidated]) -> Json:
    kinds = dict.fromkeys(left.kind for left in left_out)
    return {
        kind: _in_percent(summary(e for left in left_out if left.kind == kind for e in left.errors))
        for kind in kinds
    }


def line(answer: Json) -> Json:
    """Return one law's line of the demo's comparison."""
    return {key: answer[key] for key in ("law", "summary", "cost_percent", "cpu_s", "passivity_min")}
