"""Peers that cannot live beside the others, as their pins hold NumPy back: an environment of their own.

``python -m bench --peers`` makes it, in ``build/bench/peers``, from ``requirements-peers.lock`` (the group
``peers`` of ``pyproject.toml``); ``make bench`` does so first. Without it these peers are gaps in the tables.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

__all__ = ["PEERS", "interpreter", "make", "versions"]

ROOT = Path(__file__).parents[1]
LOCK = ROOT / "requirements-peers.lock"
FOLDER = ROOT / "build" / "bench" / "peers"
PEERS = ("control", "sysidentpy", "pybamm", "pybop")


def interpreter() -> Path:
    """Return the Python of the peers' environment, whether it is there or not."""
    return FOLDER / "bin" / "python"


def make() -> None:
    """Make the environment, or bring it to what the lock file says.

    Raises
    ------
    subprocess.CalledProcessError
        The environment cannot be made; what it could not do is on standard error.
    """
    if not interpreter().is_file():
        subprocess.run([sys.executable, "-m", "venv", str(FOLDER)], check=True)
    quiet = ["--quiet", "--disable-pip-version-check", "--require-hashes"]
    subprocess.run([str(interpreter()), "-m", "pip", "install", *quiet, "-r", str(LOCK)], check=True)


def versions() -> dict[str, str]:
    """Return the versions of the peers and of the NumPy beside them."""
    code = (
        "import json\nfrom importlib.metadata import version, PackageNotFoundError\nfound = {}\n"
        f"for name in {(*PEERS, 'numpy')!r}:\n"
        "    try:\n        found[name] = version(name)\n"
        "    except PackageNotFoundError:\n        found[name] = 'absent'\n"
        "print(json.dumps(found))"
    )
    if not interpreter().is_file():
        return dict.fromkeys(PEERS, "absent")
    done = subprocess.run([str(interpreter()), "-c", code], capture_output=True, text=True, check=True)
    found: dict[str, str] = json.loads(done.stdout)
    return found
