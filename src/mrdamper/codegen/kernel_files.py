"""Collect the kernel files for an export, and the flags that the kernel header defines."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

_ENTRY, _THERMAL_ENTRY = "controller.c", "thermal.c"
"""Main kernel files of an export. The files that they include are exported as well."""


@cache
def kernel_files(*, thermal: bool = False) -> Mapping[str, str]:
    """Return the texts of all kernel files that an export needs, by file name."""
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
    """A flag of the kernel: name in C, value (one bit), and meaning."""

    name: str
    value: int
    text: str


@cache
def flag_texts() -> tuple[FlagText, ...]:
    """Return the flags that the header ``controller.h`` of the kernel defines."""
    found = re.search(
        r"/\* Flags of the last step.*?\benum \{(.*?)\};", kernel_files()["controller.h"], re.DOTALL
    )
    lines = re.findall(
        r"(MRD_\w+) = (\d+),?[ \t]*(?:/\*\s*(.*?)\s*\*/)?", found[1] if found else "", re.DOTALL
    )
    return tuple(
        FlagText(
            name, int(bit), re.sub(r"\s+", " ", text or name.partition("_")[2].replace("_", " ").lower())
        )
        for name, bit, text in lines
    )
