"""Header words select columns."""

from __future__ import annotations

import numpy as np
import pytest

from mrdamper.data.channels import ChannelMap
from mrdamper.data.formats.table import Layout, Table
from mrdamper.data.proposal.roles import find_columns


def table(**columns: object) -> Table:
    """Return a table with these columns. In names, ``__`` separates a unit: ``force__N`` is ``force [N]``."""
    named = {f"{name.replace('__', ' [', 1)}]" if "__" in name else name: np.asarray(values, float)
             for name, values in columns.items()}  # fmt: skip
    rows = max(map(len, named.values()))
    return Table(names=(*named,), columns=named, texts={}, layout=Layout("text"), rows=rows)


# --------------------------------------------------------------------------------------- selection of columns

MOVED = {"time__s": np.arange(50.0), "displacement__mm": np.arange(50.0)}


def named(role: str, **columns: object) -> str:
    """Return the name of the column that is found for this role."""
    found = find_columns(table(**columns), ChannelMap(), "run.csv")
    return next(column.name for column in found if column.role == role)


@pytest.mark.parametrize(
    ("role", "wins", "loses"),
    [
        ("force", "force__N", "force_setpoint__N"),
        ("force", "force__N", "F__N"),
        ("force", "load__N", "x2__N"),
        ("temperature", "fluid_temperature__degC", "temperature__degC"),
        ("temperature", "temperature__degC", "ambient_temperature__degC"),
        ("current", "current__A", "current_setpoint__A"),
        ("force", "Model Root/ADC/F_damper[N]/Out1", "Model Root/Plant/F_sim[N]/Out1"),
        ("current", "Platform()://Model Root/i_meas[A]/Out1", "Model Root/CTRL/i_ref[A]/Out1"),
        ("current", "I_meas_A", "I_set_A"),
        ("current", "aram_mert__A", "aram_alapjel__A"),
        ("current", "mitattu_virta__A", "virta_asetusarvo__A"),
    ],
)
@pytest.mark.parametrize("first", ["wins", "loses"])
def test_header_words_decide_between_columns_of_same_unit(role, wins, loses, first):
    """Measured values are preferred to set points, words to symbols, and fluid to air, in any order."""
    order = (wins, loses) if first == "wins" else (loses, wins)
    others = {} if role == "force" else {"force__N": np.ones(50)}
    found = named(role, **MOVED, **dict.fromkeys(order, np.ones(50)), **others)
    assert (found,) == table(**{wins: [0.0]}).names
