"""What kind of input a file seems to be, so that a form offers those that fit first.

A guess at its first lines, for lists alone: nothing is parsed here. The job that takes a file tells what is
wrong with it.
"""

from __future__ import annotations

import re
from functools import lru_cache
from pathlib import Path

_LOOKED_AT = 1 << 14  # bytes

# The first that is found in a line of its own tells the kind.
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


def kind_of_input(path: Path) -> str | None:
    """Return what an input seems to be; None where its beginning does not tell."""
    try:
        found = path.stat()
        return _kind(path, found.st_size, found.st_mtime_ns)
    except OSError:
        return None


@lru_cache(maxsize=1024)
def _kind(path: Path, _size: int, _time: int) -> str | None:
    with path.open("rb") as file:
        text = file.read(_LOOKED_AT).decode("utf-8", errors="replace")
    if path.suffix.lower() == ".toml":
        lines = [line.strip() for line in text.splitlines()]
        said = ((kind, re.compile(pattern)) for kind, pattern in _TOML)
        return next((kind for kind, known in said if any(known.match(line) for line in lines)), None)
    if path.suffix.lower() == ".csv":
        head = next((line for line in text.splitlines() if line.strip() and not line.startswith("#")), "")
        return next((kind for kind, pattern in _CSV if re.search(pattern, head)), None)
    return None
