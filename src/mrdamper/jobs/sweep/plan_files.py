"""What a sweep's plan names, for whoever must know before it is run: texts as written, and their files.

A server that runs plans of others looks here first; what a plan is, is the business of ``sweep.plan``.
"""

from __future__ import annotations

from pathlib import Path

from mrdamper.files import read_toml
from mrdamper.jobs.sweep.plan import is_words, read_plan
from mrdamper.thermal.drawing_file import DRAWINGS

_PATHS = ("campaigns", "channels", "card", "dampers", "duties")  # keys whose texts may be paths


def texts_of_plan(plan: Path) -> list[str]:
    """Return the texts in a plan that may name files; nothing is looked for yet.

    Raises
    ------
    InputError
        Not a TOML file.
    """
    found: list[object] = []
    for table in read_toml(plan, "sweep").values():
        if isinstance(table, dict):
            for key in _PATHS:
                given = table.get(key, [])
                found += given if isinstance(given, list) else [given]
    return [text for text in found if isinstance(text, str) and text not in DRAWINGS and not is_words(text)]


def files_of_plan(plan: Path) -> list[Path]:
    """Return the files that the tasks of a plan read.

    Raises
    ------
    InputError
        A plan that cannot be, or a pattern that nothing matches.
    """
    return list(read_plan(plan).reads)
