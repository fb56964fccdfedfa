"""Run the benchmarks: ``python -m bench [NAME ...]``; without a name, all of them, as Markdown tables."""

from __future__ import annotations

import argparse
import sys
from importlib import import_module

from bench.measure import Row, asked_table, machine, table

SIZED = ("simulation", "identification", "commands", "growth", "startup")  # take --full
NAMES = (*SIZED, "laws", "controller", "heating")


def main() -> None:
    """Print each benchmark as a Markdown table, and what was asked, measured and met."""
    parser = argparse.ArgumentParser(prog="python -m bench", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"one or more of {', '.join(NAMES)}")
    parser.add_argument(
        "--full", action="store_true", help="the whole problems, not shares of them: minutes to hours"
    )
    parser.add_argument(
        "--only", default="", help="of the commands, the rows whose titles have these words in them"
    )
    parser.add_argument(
        "--instructions", action="store_true", help="renew bench/instructions.json (valgrind)"
    )
    parser.add_argument(
        "--check", action="store_true", help="check how times are judged, and the kernel's instructions"
    )
    given = parser.parse_args()
    if given.check:
        sys.exit(import_module("bench.check").check())
    if given.instructions:
        import_module("bench.instructions").renew()
        return
    unknown = [name for name in given.names if name not in NAMES]
    if unknown:
        parser.error(f"no benchmark is called {unknown[0]!r}; there are {', '.join(NAMES)}")
    print(machine())
    for name in given.names or NAMES:
        options = {"full": given.full} if name in SIZED else {}
        options |= {"only": given.only} if name == "commands" else {}
        rows: list[Row] = import_module(f"bench.{name}").run(**options)
        print(f"\n{table(name, rows)}\n{asked_table(rows)}", flush=True)


if __name__ == "__main__":
    main()
