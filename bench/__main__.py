"""Run the benchmarks: ``python -m bench [NAME ...] [--out FILE]``; without a name, all of them."""

from __future__ import annotations

import argparse
import json
from importlib import import_module
from pathlib import Path

from bench.measure import Row, asked_table, machine, table

NAMES = (
    "simulation", "startup", "identification", "temperature", "tracking", "series_valve", "controller", "target",
)  # fmt: skip


def main() -> None:
    """Print each benchmark as a Markdown table and write all rows, with the machine, to a JSON file."""
    parser = argparse.ArgumentParser(prog="python -m bench", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"one or more of {', '.join(NAMES)}")
    parser.add_argument(
        "--out", type=Path, default=Path("build/bench/results.json"), help="where the JSON goes"
    )
    given = parser.parse_args()
    unknown = [name for name in given.names if name not in NAMES]
    if unknown:
        parser.error(f"no benchmark is called {unknown[0]!r}; there are {', '.join(NAMES)}")
    here = machine()
    print(", ".join(f"{key} {value}" for key, value in here.items()))
    results: dict[str, object] = {"machine": here}
    for name in given.names or NAMES:
        rows: list[Row] = import_module(f"bench.{name}").run()
        print(f"\n{table(name, rows)}\n{asked_table(rows)}", flush=True)
        results[name] = [row.as_json() for row in rows]
    given.out.parent.mkdir(parents=True, exist_ok=True)
    partial = given.out.with_suffix(".part")
    partial.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    partial.replace(given.out)
    print(f"\nwritten: {given.out}")


if __name__ == "__main__":
    main()
