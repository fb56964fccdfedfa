"""Tables and pictures of kept results, and the page ``docs/benchmarks.md`` that quotes them.

Nothing is measured here.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from bench.measure import Asked, Row, asked_table, table

__all__ = [
    "PAGE",
    "PICTURES",
    "RESULTS",
    "draw",
    "rows_of",
    "search_points",
    "table_of",
    "tables",
    "write",
    "written",
]

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "bench" / "results.json"
PAGE = ROOT / "docs" / "benchmarks.md"
PICTURES = ROOT / "docs" / "pictures"
NOT_RESULTS = {"machine", "runs"}

_COST = re.compile(r"cost ([\d.]+) x the floor")
_OF_THEIR_OWN = "In an environment of their own: "
_MADE = re.compile(r"(<!-- bench:(?P<name>\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


def rows_of(kept: Sequence[Mapping[str, Any]]) -> list[Row]:
    """Return the rows that a benchmark's JSON holds."""
    rows = []
    for each in kept:
        asked = tuple(
            Asked(**{key: value for key, value in one.items() if key != "is_met"})
            for one in each.get("asked", ())
        )
        spread = tuple(each["spread"]) if "spread" in each else None
        rows.append(Row(**{**each, "asked": asked, "spread": spread}))
    return rows


def tables(results: Mapping[str, Any]) -> str:
    """Return all results as Markdown."""
    names = [name for name in results if name not in NOT_RESULTS]
    return "\n\n".join(f"## {name}\n\n{table_of(results, name)}" for name in names) + "\n"


def table_of(results: Mapping[str, Any], name: str) -> str:
    """Return one benchmark's tables as Markdown, below the machine that they are of."""
    if name == "machine":
        return _machine(results)
    if name not in results:
        return f"*Not kept. `python -m bench {name}` prints it.*"
    rows, run = rows_of(results[name]), results["runs"][name]
    head = (
        f"Sizes: {run['sizes']}. {run['cpu_s']:g} s of CPU; load of the machine before it: {run['load']:g}."
    )
    made = table(name, rows).partition("\n")[2].strip("\n")
    asked = asked_table(rows).strip("\n")
    return "\n\n".join(part for part in (head, made, asked) if part)


def _machine(results: Mapping[str, Any]) -> str:
    here = results["machine"]
    said = [f"{here['processor']}, {here['system']}, Python {here['python']}."]
    for kind in ("packages", "peers", "programs"):
        each = (
            version if version.startswith(name) else f"{name} {version}"
            for name, version in here.get(kind, {}).items()
        )
        listed = ", ".join(each)
        said += [f"{_OF_THEIR_OWN if kind == 'peers' else ''}{listed}."] if listed else []
    return "\n".join(said)


def written(text: str, results: Mapping[str, Any]) -> str:
    """Return the page with every table between its marks made anew."""
    return _MADE.sub(lambda found: f"{found[1]}\n{table_of(results, found['name'])}\n\n{found[3]}", text)


def write() -> None:
    """Write the page and its pictures from the kept results."""
    results = json.loads(RESULTS.read_text(encoding="utf-8"))
    PAGE.write_text(written(PAGE.read_text(encoding="utf-8"), results), encoding="utf-8")
    print(f"written: {PAGE}")
    for picture in draw(results, PICTURES):
        print(f"written: {picture}")


# ------------------------------------------------------------------------------------ pictures


def draw(results: Mapping[str, Any], folder: Path) -> list[Path]:
    """Draw what the results have pictures for, as PNG files in a folder; return them."""
    drawn = []
    if "simulation" in results:
        drawn.append(_accuracy(rows_of(results["simulation"]), folder / "bench_accuracy.png"))
    if "identification" in results:
        drawn.append(_searches(rows_of(results["identification"]), folder / "bench_identification.png"))
    return drawn


def _accuracy(rows: Sequence[Row], place: Path) -> Path:
    """Draw error against cost of every integrator: nearer the lower left corner is better."""
    from matplotlib.figure import Figure

    lines: dict[str, list[tuple[float, float]]] = {}
    for row in rows:
        if row.group == "accuracy against cost" and row.error is not None and row.ns_per_sample is not None:
            name = re.sub(r", (substeps|tolerance) .*", "", row.contender)
            lines.setdefault(name, []).append((row.ns_per_sample, row.error))
    figure = Figure(figsize=(8.5, 4.5), layout="constrained")
    axes = figure.add_subplot()
    for (name, points), mark in zip(lines.items(), "*sov^<>DPX", strict=False):
        size = 14 if name == "mrdamper kernel" else 5
        axes.loglog(*zip(*points, strict=True), marker=mark, markersize=size, label=name)
    axes.set_xlabel("CPU time per candidate and sample [ns]")
    axes.set_ylabel("largest error over the largest force")
    axes.grid(which="major", alpha=0.3)
    figure.legend(loc="outside right upper", fontsize="small")
    return _saved(figure, place)


def search_points(rows: Sequence[Row]) -> dict[str, tuple[float, float]]:
    """Return CPU time over ours and cost over the floor of each search that ran on the campaign."""
    points = {}
    for row in rows:
        cost = _COST.search(row.accuracy)
        if cost is not None and row.ratio is not None:
            points[row.contender] = (row.ratio, float(cost[1]))
    return points


def _searches(rows: Sequence[Row], place: Path) -> Path:
    """Draw cost over the noise floor against CPU time over ours: the lower left corner is better."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.5, 4.5), layout="constrained")
    axes = figure.add_subplot()
    for (name, point), mark in zip(search_points(rows).items(), "*sov^<>DPXhd", strict=False):
        axes.loglog(*point, mark, markersize=14 if mark == "*" else 7, label=name)
    axes.axhline(1.01, color="0.6", linewidth=0.8, linestyle="--", label="1 % above the floor")
    axes.set_xlabel("CPU time over that of variable projection")
    axes.set_ylabel("cost over the noise floor")
    axes.grid(which="major", alpha=0.3)
    figure.legend(loc="outside lower center", ncols=2, fontsize="small")
    return _saved(figure, place)


def _saved(figure: Any, place: Path) -> Path:  # noqa: ANN401 - matplotlib is imported where it is used
    place.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(place, dpi=110, metadata={"Software": None})
    return place
