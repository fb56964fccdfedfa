"""Choices in web forms: names that options accept, and kinds of input files.

Only modules that load fast are imported (no SciPy, no table reader), because a server needs the names when
the server starts. The kind of a file (fluid, geometry, ...) is guessed from the first lines of the file. The
job that reads the file checks the content.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType

from mrdamper.control.controllers import NAMES
from mrdamper.control.scenario import SCENARIOS
from mrdamper.data.tables import FORMATS
from mrdamper.jobs.public_data import DATA_SETS
from mrdamper.models.fluids.fluid_file import PRESETS as FLUIDS
from mrdamper.models.laws import LAWS
from mrdamper.quantities import QUANTITIES
from mrdamper.thermal.drawing_file import DRAWINGS, DrawingTables
from mrdamper.thermal.heatsink import HeatSink
from mrdamper.thermal.materials import MATERIALS
from mrdamper.virtual_rig.campaign import CAMPAIGNS
from mrdamper.virtual_rig.damper import PRESETS as DAMPERS

__all__ = ["WRITTEN", "HeatSink", "choices", "kind_of_input", "run_formats"]

_HEAD_SIZE_BYTES = 1 << 14
# Kind of file and regular expression. The first expression that matches the beginning of a line decides.
_TOML: tuple[tuple[str, str], ...] = (
    ("channels", r"\[(channel(\.\w+)?|constant|segments)\]"),
    ("geometry", r"\[body\]"),
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
WRITTEN: Mapping[str, type] = MappingProxyType({"geometry": DrawingTables})
"""Kinds of files that a web form can edit table by table, with the class of the content of each kind."""


@lru_cache(maxsize=1024)
def kind_of_input(path: Path, _size: int, _time: int) -> str | None:
    """Return the probable kind of an input file; None if the first lines match no kind."""
    with path.open("rb") as file:
        lines = file.read(_HEAD_SIZE_BYTES).decode("utf-8", errors="replace").splitlines()
    if path.suffix.lower() == ".csv":
        head = next((line for line in lines if line.strip() and not line.startswith("#")), "")
        return next((kind for kind, pattern in _CSV if re.search(pattern, head)), None)
    text = "\n".join(line.strip() for line in lines)
    return next((kind for kind, pattern in _TOML if re.search(f"^({pattern})", text, re.MULTILINE)), None)


def choices() -> dict[str, object]:
    """Return the names (of laws, fluids, ...) that job options accept, with titles and units if available."""
    return {
        "laws": [
            {"name": "auto", "title": "compare all, take the best"},
            *({"name": law.name, "title": law.title} for law in LAWS.values()),
        ],
        "fluids": list(FLUIDS),
        "dampers": list(DRAWINGS),
        "plants": list(DAMPERS),
        "campaigns": list(CAMPAIGNS),
        "targets": list(SCENARIOS),
        "controllers": list(NAMES),
        "data": [{"name": each.name, "title": f"{each.title} ({each.licence})"} for each in DATA_SETS],
        "materials": [name for name in MATERIALS if name != "winding"],
        "roles": [
            {
                "role": each.role,
                "symbol": each.symbol,
                "unit": each.unit,
                "units": list(each.units),
                "needed": each.role in {"displacement", "force"},
            }
            for each in QUANTITIES.values()
        ],
    }


def run_formats() -> list[str]:
    """Return the file name suffixes of all readable formats of runs, sorted."""
    return sorted({suffix for known in FORMATS for suffix in known.suffixes})
