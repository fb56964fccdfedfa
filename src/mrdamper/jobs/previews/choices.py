"""List the names that options accept (laws, fluids, targets, controllers, roles) as one JSON object.

Web forms offer these names, and jobs interpret them. Only modules that load fast are imported (no SciPy, no
table reader), because a server needs the names when it starts.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from mrdamper.control.controllers import NAMES
from mrdamper.control.scenario import SCENARIOS
from mrdamper.data.tables import FORMATS
from mrdamper.jobs.public_data.catalog import DATA_SETS
from mrdamper.models.fluids.fluid_file import PRESETS as FLUIDS
from mrdamper.models.laws import LAWS
from mrdamper.quantities import QUANTITIES
from mrdamper.thermal.drawing_file import DRAWINGS, DrawingTables
from mrdamper.thermal.heatsink import HeatSink
from mrdamper.thermal.materials import MATERIALS
from mrdamper.virtual_rig.campaign import CAMPAIGNS
from mrdamper.virtual_rig.damper import PRESETS as DAMPERS

__all__ = ["WRITTEN", "HeatSink", "choices", "run_formats"]

WRITTEN: Mapping[str, type] = MappingProxyType({"drawing": DrawingTables})
"""Kinds of files that a web form can edit table by table, with the class of the content of each kind."""


def choices() -> dict[str, object]:
    """Return all names that the options of jobs accept, with titles and units if available."""
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
