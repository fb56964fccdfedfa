"""Run the benchmarks: ``python -m bench [NAME ...]``; without a name, all of them.

The rows go to a JSON file that keeps what it has of the benchmarks that were not run, and beside it, as
Markdown tables and pictures. ``--page`` runs nothing: it writes the tables of ``docs/benchmarks.md`` from
``bench/results.json``, the kept results.
"""

from __future__ import annotations

import argparse
import json
import time
from importlib import import_module
from pathlib import Path
from typing import Any

from bench import page
from bench.measure import Row, asked_table, cpu_clock, machine, table

SIZED = (
    "simulation",
    "startup",
    "identification",
    "heating",
    "controller",
    "growth",
    "commands",
)  # take --full
NAMES = (*SIZED, "laws", "web")


def main() -> None:
    """Print each benchmark as a Markdown table and write all rows, with the machine, to a JSON file."""
    parser = argparse.ArgumentParser(prog="python -m bench", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"one or more of {', '.join(NAMES)}")
    parser.add_argument(
        "--out", type=Path, default=Path("build/bench/results.json"), help="where the JSON goes"
    )
    parser.add_argument(
        "--full", action="store_true", help="the whole problems, not shares of them: minutes to hours"
    )
    parser.add_argument(
        "--page", action="store_true", help="write docs/benchmarks.md from bench/results.json"
    )
    parser.add_argument(
        "--peers", action="store_true", help="make the environment of the peers that need one"
    )
    parser.add_argument(
        "--instructions", action="store_true", help="renew bench/instructions.json (valgrind)"
    )
    parser.add_argument(
        "--check", action="store_true", help="check the contenders, and the kernel's instructions"
    )
    given = parser.parse_args()
    if given.page:
        page.write()
        return
    if given.peers:
        from bench import peers

        peers.make()
        return
    if given.check:
        from bench.check import check

        check()
    if given.instructions:
        from bench import instructions

        instructions.renew()
        return
    unknown = [name for name in given.names if name not in NAMES]
    if unknown:
        parser.error(f"no benchmark is called {unknown[0]!r}; there are {', '.join(NAMES)}")
    for name in given.names or NAMES:
        here = machine()
        start, begin = time.perf_counter(), cpu_clock()
        made = import_module(f"bench.{name}").run
        rows: list[Row] = made(full=given.full) if name in SIZED else made()
        print(f"\n{table(name, rows)}\n{asked_table(rows)}", flush=True)
        here |= {"cpu_s": round(cpu_clock() - begin, 1), "wall_s": round(time.perf_counter() - start, 1)}
        here["sizes"] = "full" if given.full and name in SIZED else "usual"
        keep(given.out, name, rows, here)
    print(f"\nwritten: {given.out}")


def keep(place: Path, name: str, rows: list[Row], here: dict[str, object]) -> None:
    """Put one benchmark's rows into the results, whole or not at all; draw them anew."""
    results: dict[str, Any] = {}
    if place.is_file():
        results = json.loads(place.read_text(encoding="utf-8"))
    known = {*page.NOT_RESULTS, *results.get("runs", {})}  # an older form had no runs
    results = {key: value for key, value in results.items() if key in known}
    results[name] = [row.as_json() for row in rows]
    of_all = ("processor", "system", "python", "packages", "peers", "programs")
    results["machine"] = {key: here[key] for key in of_all}
    results.setdefault("runs", {})[name] = here
    place.parent.mkdir(parents=True, exist_ok=True)
    partial = place.with_suffix(".part")
    partial.write_text(json.dumps(results, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    partial.replace(place)
    if place.resolve() == page.RESULTS:  # the page is made of it
        return
    place.with_suffix(".md").write_text(page.tables(results), encoding="utf-8")
    page.draw(results, place.parent)


if __name__ == "__main__":
    main()
