"""The kernel's own files, as they go into an export, and the flags that its header names."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

_ENTRY, _THERMAL_ENTRY = "controller.c", "thermal.c"
"""Of the kernel; what they include goes with them."""


@cache
def kernel_files(*, thermal: bool = False) -> Mapping[str, str]:
    """Return the kernel's files that a target needs, by name: the steps and all that they include."""
    folder = files("mrdamper.core").joinpath("kernel")
    found: dict[str, str] = {}
    waiting = [_ENTRY, *([_THERMAL_ENTRY] if thermal else [])]
    while waiting:
        name = waiting.pop(0)
        if name not in found:
            found[name] = folder.joinpath(name).read_bytes().decode("utf-8")
            waiting += re.findall(r'^\s*#\s*include\s+"([^"]+)"', found[name], re.MULTILINE)
    return dict(sorted(found.items()))


@dataclass(frozen=True, slots=True)
class FlagText:
    """A flag of the kernel: its name in C, its bit, and what it says."""

    name: str
    value: int
    text: str


@cache
def flag_texts() -> tuple[FlagText, ...]:
    """Return the flags as the kernel's header has them."""
    found = re.search(
        r"/\* Flags of the last step.*?\benum \{(.*?)\};", kernel_files()["controller.h"], re.DOTALL
    )
    lines = re.findall(
        r"(MRD_\w+) = (\d+),?[ \t]*(?:/\*\s*(.*?)\s*\*/)?", found[1] if found else "", re.DOTALL
    )
    return tuple(FlagText(name, int(bit), re.sub(r"\s+", " ", text)) for name, bit, text in lines)
