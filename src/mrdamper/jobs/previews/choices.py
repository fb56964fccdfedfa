"""Names that may be given beside files: laws, fluids, targets, controllers, roles, as one JSON-ready object.

For whoever draws a form; what a choice does is the business of the job that takes it. Only light modules are
loaded (no SciPy, no table reader): a server asks for this before anything else.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from mrdamper.control.controllers import NAMES
from mrdamper.control.scenario import SCENARIOS
from mrdamper.data.tables import FORMATS
from mrdamper.models.fluids.fluid_file import PRESETS as FLUIDS
from mrdamper.models.laws import LAWS
from mrdamper.quantities import QUANTITIES
from mrdamper.thermal.drawing_file import DRAWINGS, DrawingTables
from mrdamper.thermal.materials import MATERIALS
from mrdamper.virtual_rig.campaign import CAMPAIGNS
from mrdamper.virtual_rig.damper import PRESETS as DAMPERS

WRITTEN: Mapping[str, type] = MappingProxyType({"drawing": DrawingTables})
"""Files that a form can fill in, table by table: the record of each."""


def choices() -> dict[str, object]:
    """Return every name that a job's options take, with titles and units where there are any."""
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
    """Return the suffixes of the files that are read as runs."""
    return sorted({suffix for known in FORMATS for suffix in known.suffixes})
