"""Guess of the kind of an input file, so that a form offers suitable files only.

The guess uses the first lines and is for lists only. The job that reads a file reports what is wrong with it.
"""

from __future__ import annotations

import re
from functools import lru_cache
from pathlib import Path

_HEAD_SIZE_BYTES = 1 << 14

# The first pattern that matches the beginning of a line decides the kind.
_TOML: tuple[tuple[str, str], ...] = (
    ("channels", r"\[(channel(\.\w+)?|constant|segments)\]"),
    ("drawing", r"\[body\]"),
    ("scenario", r"\[(target|sensors|disturbance)\]|target\s*="),
    ("campaign", r"motions\s*="),
    ("fluid", r"\[(viscosity|yield_stress|magnetisation|induction)\b.*|particle_fraction\s*="),
    ("sink", r"\[sink\]"),
    ("damper", r"preset\s*="),
)
_CSV: tuple[tuple[str, str], ...] = (
    ("rheometer", r"viscosity|yield_stress"),
    ("curve", r"(fluid|body|coil|wall)_(degC|K)\b"),
    ("duty", r"(current|voltage|velocity|displacement)_"),
)


@lru_cache(maxsize=1024)
def kind_of_input(path: Path, _size: int, _time: int) -> str | None:
    """Return the probable kind of an input; None if its first lines match no kind."""
    with path.open("rb") as file:
        lines = file.read(_HEAD_SIZE_BYTES).decode("utf-8", errors="replace").splitlines()
    if path.suffix.lower() == ".csv":
        head = next((line for line in lines if line.strip() and not line.startswith("#")), "")
        return next((kind for kind, pattern in _CSV if re.search(pattern, head)), None)
    text = "\n".join(line.strip() for line in lines)
    return next((kind for kind, pattern in _TOML if re.search(f"^({pattern})", text, re.MULTILINE)), None)
