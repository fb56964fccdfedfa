"""Generate the C source of an extension for cffi: ``python generate_binding.py NAME OUTPUT``.

The declarations are those of ``interface.h`` and of the headers that it includes.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from cffi import FFI

CORE = Path(__file__).parents[1] / "src" / "mrdamper" / "core"
FOLDERS = (CORE / "binding", CORE / "kernel")


def declarations(header: str, *, single: bool) -> str:
    """Return the declarations of a header and of the headers that it includes, in the C subset of cffi.

    Constants with a number as value are kept. All other preprocessor lines are removed.
    """
    path = next(folder / header for folder in FOLDERS if (folder / header).is_file())
    text = re.sub(r"/\*.*?\*/", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    branch = 1 if single else 2
    text = re.sub(
        r"^#ifdef MRD_SINGLE\n(.*?)^#else\n(.*?)^#endif\n",
        lambda found: found[branch],
        text,
        flags=re.DOTALL | re.MULTILINE,
    )
    text = re.sub(
        r'^#include "(.*)"', lambda found: declarations(found[1], single=single), text, flags=re.MULTILINE
    )
    text = re.sub(r"^#(?!define MRD_\w+ +\d+u?[ \t]*$).*", "", text, flags=re.MULTILINE)
    return re.sub(r"^MRD_TRACK_API.*?;", "", text, flags=re.DOTALL | re.MULTILINE)


def main(name: str, output: str) -> None:
    """Write the C source of the extension ``mrdamper.core.NAME``."""
    single = name == "_single"
    ffi = FFI()
    ffi.cdef(declarations("interface.h", single=single))
    prelude = '#include "interface.h"\n'
    ffi.set_source(f"mrdamper.core.{name}", f"#define MRD_SINGLE\n{prelude}" if single else prelude)
    ffi.emit_c_code(output)


if __name__ == "__main__":
    main(*sys.argv[1:])
