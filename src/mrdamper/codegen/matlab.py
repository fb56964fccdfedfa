"""Write a folder with the force map for MATLAB, Octave and Modelica.

``damper.mat`` contains the struct ``damper``: description and coefficients of the card, and a field ``map``
with breakpoints and tables. The dimensions of the tables are (temperature, command, velocity), as the n-D
Lookup Table of Simulink expects. The file format is MAT version 5, which MATLAB, Octave and the vehicle
libraries of Modelica can read. ``damper_tables.txt`` contains the same tables as text in the format of
``CombiTable2Ds`` in Modelica: for each temperature, one table of force versus velocity (rows) and command
(columns).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from mrdamper import __version__
from mrdamper.codegen.table import ForceMap
from mrdamper.models.card_schema import card_sha256, card_text
from mrdamper.quantities import ZERO_CELSIUS_K

_SCRIPTS = Path(__file__).parent / "templates"
_NAMES = ("mrdamper_load.m", "mrdamper_force.m")


def write_matlab(table: ForceMap, folder: Path) -> None:
    """Write the MAT file, the MATLAB functions and the text tables into a folder."""
    from scipy.io import savemat

    folder.mkdir(exist_ok=True)
    # The file is opened here because savemat does not report why a file cannot be opened.
    with (folder / "damper.mat").open("wb") as file:
        save: Any = savemat  # The type stubs of savemat do not accept an open file.
        save(file, {"damper": _struct(table)}, do_compression=True, oned_as="row")
    for name in _NAMES:
        (folder / name).write_bytes((_SCRIPTS / name).read_bytes())
    (folder / "damper_tables.txt").write_text(tables_text(table), encoding="ascii", newline="\n")


def _struct(table: ForceMap) -> dict[str, Any]:
    """Return the card and the force map as the content of a MATLAB struct. Unknown values are NaN."""
    card = table.card
    parameters = card.damper.parameters
    errors = [card.standard_errors.get(name) for name in parameters]
    return {
        "title": card.title,
        "law": card.damper.law.name,
        "fingerprint": card_sha256(card),
        "written_by": f"mrdamper {__version__}",
        "command_unit": card.damper.command_unit,
        "card_json": card_text(card),
        "parameters": {
            "name": np.array([*parameters], dtype=object),
            "value": np.array([*parameters.values()], dtype=np.float64),
            "standard_error": np.array([np.nan if error is None else error for error in errors]),
        },
        "map": {
            "amplitude_m": table.amplitude,
            "temperature_degC": table.temperature - ZERO_CELSIUS_K,
            "command": table.command,
            "velocity_m_s": table.velocity,
            "force_N": table.pick,
            "force_rising_N": table.rising,
            "force_falling_N": table.falling,
        },
    }


def tables_text(table: ForceMap) -> str:
    """Return the force tables in the text format of Modelica.

    The first row and the first column of each table contain the breakpoints.
    """
    lines = ["#1", "# force [N] over velocity [m/s] (down) and command (across); extension positive"]
    for kelvin, forces in zip(table.temperature, table.pick, strict=True):
        name = f"force_{kelvin - ZERO_CELSIUS_K:.0f}degC".replace("-", "minus")
        rows = np.vstack([[0.0, *table.command], np.column_stack([table.velocity, forces.T])])
        lines.append(f"double {name}({rows.shape[0]},{rows.shape[1]})")
        lines += [" ".join(f"{value:.9g}" for value in row) for row in rows]
    return "\n".join(lines) + "\n"
