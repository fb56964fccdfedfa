"""What can be chosen: laws, methods, fluids, targets, controllers, roles, as one JSON-ready object.

For whoever draws a form; what a choice does is the business of the job that takes it. Only light modules are
loaded (no SciPy, no table reader): a server asks for this before anything else. Lists whose home is heavy
stand here again, and a test holds the two together.
"""

from __future__ import annotations

from typing import get_args

from mrdamper.control.controllers import NAMES
from mrdamper.control.scenario import SCENARIOS
from mrdamper.data.tables import FORMATS
from mrdamper.models.fluids.fluid_file import PRESETS as FLUIDS
from mrdamper.models.laws import LAWS
from mrdamper.quantities import QUANTITIES
from mrdamper.rig.damper import PRESETS as DAMPERS
from mrdamper.thermal.drawing_file import DRAWINGS
from mrdamper.thermal.heatsink import FinLaw
from mrdamper.thermal.materials import MATERIALS

__all__ = ["DUTY", "LEAVE_OUT", "METHODS", "TEMPERATURES", "TERMS", "choices", "run_formats"]

METHODS = ("varpro", "genetic", "cma")
TERMS = ("friction", "mass", "viscosity", "thinning", "gas")
TEMPERATURES = ("auto", "none", "arrhenius", "reynolds", "vft", "paper")
LEAVE_OUT = ("run", "current", "motion", "temperature")
DUTY = "sine:15mm:1Hz:2A:1800s"


def choices() -> dict[str, object]:
    """Return every name that a job's options take, with titles and units where there are any."""
    return {
        "laws": [
            {
                "name": law.name,
                "title": law.title,
                "coefficients": [
                    {"name": each.name, "unit": each.unit, "description": each.description}
                    for each in law.coefficients
                ],
            }
            for law in LAWS.values()
        ],
        "methods": list(METHODS),
        "terms": list(TERMS),
        "temperature": list(TEMPERATURES),
        "leave_out": list(LEAVE_OUT),
        "fluids": list(FLUIDS),
        "dampers": list(DRAWINGS),
        "plants": list(DAMPERS),
        "rig_presets": list(DAMPERS),
        "targets": list(SCENARIOS),
        "controllers": list(NAMES),
        "materials": list(MATERIALS),
        "correlations": list(get_args(FinLaw)),
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
        "duty": DUTY,
    }


def run_formats() -> list[str]:
    """Return the suffixes of the files that are read as runs."""
    return sorted({suffix for known in FORMATS for suffix in known.suffixes})
