"""Run independent programs whose results are compared with the finite elements of the package."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from mrdamper.errors import InputError

__all__ = ["run_program"]


def run_program(name: str, arguments: Sequence[str], folder: Path, *, package: str) -> str:
    """Run a program in a folder and return its output.

    Raises
    ------
    InputError
        If the program is not installed (the message names the Debian package), or if it fails.
    """
    found = shutil.which(name)
    if found is None:
        raise InputError(f"the program {name!r} is not installed; install the Debian package {package}")
    run = subprocess.run(
        [found, *arguments], cwd=folder, capture_output=True, text=True, errors="replace", check=False
    )
    said = run.stdout + run.stderr
    if run.returncode != 0:
        raise InputError(f"{name} ended with code {run.returncode} in {folder}: {said.strip()[-600:]}")
    return said
