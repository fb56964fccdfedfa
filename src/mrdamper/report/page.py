"""The engine of the pages: HTML files that open offline, print well, and hold names that users chose as text.

The same input gives the same bytes.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from mrdamper.errors import spelled
from mrdamper.identify.fit import versions

if TYPE_CHECKING:
    from jinja2 import Environment

__all__ = ["environment", "significant"]


def significant(value: float | None, digits: int = 3) -> str:
    """Return a number with so many digits, its zeros among them; "" for what is none."""
    if value is None or not math.isfinite(value):
        return ""
    rounded = float(f"{value:.{digits}g}")
    size = 0 if rounded == 0.0 else math.floor(math.log10(abs(rounded)))
    if not -5 < size < 7:
        return f"{rounded:.{digits}g}"
    return f"{rounded:.{max(digits - 1 - size, 0)}f}"


def environment() -> Environment:
    """Return the templates with the filters they use: a user's names are text, figures are markup."""
    import jinja2
    from markupsafe import Markup

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("mrdamper.report", "templates"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
        finalize=lambda value: spelled(value) if type(value) is str else value,
    )
    environment.globals["program"] = versions()
    environment.filters["svg"] = Markup  # our own figures, whose texts Matplotlib has escaped
    environment.filters["number"] = lambda value, digits=4: (
        "" if value is None or math.isnan(value) else f"{value:.{digits}g}"
    )
    environment.filters["digits"] = significant
    environment.filters["percent"] = lambda value: "-" if math.isnan(value) else f"{value:.1f} %"
    environment.filters["command"] = lambda e: (
        "varying" if e.command is None else f"{e.command:g} {e.command_unit}"
    )
    return environment
