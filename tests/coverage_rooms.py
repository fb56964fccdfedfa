"""Line and branch coverage of each room: ``python -m tests.coverage_rooms build/coverage.json`` prints it.

The file is what ``coverage json`` writes. A room is a folder of the package, or all of its modules that stand
alone. Ends with 1 when a room that has a least share is below it.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from pathlib import Path

__all__ = ["main", "shares"]

LEAST_BRANCHES = {"data": 0.88, "models": 0.88, "identify": 0.88, "jobs": 0.88}
_ALONE = "(modules)"


def shares(measured: dict[str, dict[str, Counter[str]]]) -> dict[str, tuple[float, float]]:
    """Return the covered share of lines and of branches, by room."""
    rooms: dict[str, Counter[str]] = {}
    for path, found in measured.items():
        inside = path.replace("\\", "/").partition("src/mrdamper/")[2]
        room = inside.split("/")[0] if "/" in inside else _ALONE
        rooms.setdefault(room, Counter()).update(found["summary"])
    return {
        room: (
            sums["covered_lines"] / max(sums["num_statements"], 1),
            sums["covered_branches"] / max(sums["num_branches"], 1),
        )
        for room, sums in sorted(rooms.items())
    }


def main(path: Path) -> int:
    """Print the table; return 1 when a room is below its least share."""
    measured = json.loads(path.read_text(encoding="utf-8"))["files"]
    print(f"{'room':12s} {'lines':>8s} {'branches':>9s} {'least':>6s}")
    short = 0
    for room, (lines, branches) in shares(measured).items():
        least = LEAST_BRANCHES.get(room)
        short += least is not None and branches < least
        asked = "" if least is None else f"{100 * least:.0f} %"
        print(f"{room:12s} {100 * lines:6.1f} % {100 * branches:7.1f} % {asked:>6s}")
    return int(short > 0)


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
