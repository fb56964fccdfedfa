"""Run benchmarks: ``python -m bench [NAME ...]``. Without a name, all benchmarks without options are run.

Three benchmarks have options and are started directly: ``python -m bench.track``, ``python -m bench.fit`` and
``python -m bench.faults``.
"""

from __future__ import annotations

import argparse
from importlib import import_module

from bench.measure import Row, limit_table, machine, table

NAMES = ("models", "peers", "fit", "heat")


def main() -> None:
    """Print each benchmark as a Markdown table, then a table of all limits with the measured values."""
    parser = argparse.ArgumentParser(prog="python -m bench", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"one or more of {', '.join(NAMES)}")
    names = parser.parse_args().names
    unknown = [name for name in names if name not in NAMES]
    if unknown:
        parser.error(f"no benchmark is called {unknown[0]!r}; expected one of {', '.join(NAMES)}")
    print(machine())
    for name in names or NAMES:
        rows: list[Row] = import_module(f"bench.{name}").run()
        print(f"\n{table(name, rows)}\n{limit_table(rows)}", flush=True)


if __name__ == "__main__":
    main()
