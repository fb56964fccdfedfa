"""Magnetorheological dampers: from measured rig runs to a model card.

>>> import mrdamper
>>> fit = mrdamper.fit({"0 A": frame, "1 A": another})  # frames, or files and folders  # doctest: +SKIP
>>> fit.plot(), fit.card().heat("paper"), fit.card().export(c="controller")  # doctest: +SKIP

Names are loaded from their modules on first use, so that importing the package (and answering
``mrdamper --help``) does not load NumPy.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mrdamper.errors import ConvergenceError, EnvelopeError, InputError, MissingExtraError, MrdamperError

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from mrdamper.data.prepare import prepare_run
    from mrdamper.data.readers import read_runs
    from mrdamper.data.records import Dataset, RigRun
    from mrdamper.identify.fit import assess
    from mrdamper.identify.settings import FitSettings
    from mrdamper.models.card import ModelCard
    from mrdamper.models.card_schema import read_card
    from mrdamper.models.damper import Damper
    from mrdamper.registry.public import read

    __version__: str
    check: Callable[..., Any]
    compare: Callable[..., Any]
    cycles: Callable[..., Any]
    demo: Callable[..., Any]
    export: Callable[..., Any]
    fetch_data: Callable[..., Any]
    fit: Callable[..., Any]
    fluid: Callable[..., Any]
    derate: Callable[..., Any]
    heat: Callable[..., Any]
    list_data: Callable[..., Any]
    evaluate: Callable[..., Any]
    rig: Callable[..., Any]
    simulate: Callable[..., Any]
    heatsink: Callable[..., Any]
    sweep: Callable[..., Any]
    track: Callable[..., Any]

__all__ = [
    "ConvergenceError",
    "Damper",
    "Dataset",
    "EnvelopeError",
    "FitSettings",
    "InputError",
    "MissingExtraError",
    "ModelCard",
    "MrdamperError",
    "RigRun",
    "__version__",
    "assess",
    "check",
    "compare",
    "cycles",
    "demo",
    "derate",
    "evaluate",
    "export",
    "fetch_data",
    "fit",
    "fluid",
    "heat",
    "heatsink",
    "list_data",
    "prepare_run",
    "read",
    "read_card",
    "read_runs",
    "rig",
    "simulate",
    "sweep",
    "track",
]

_ROOM_OF = {
    "Damper": "mrdamper.models.damper",
    "Dataset": "mrdamper.data.records",
    "ModelCard": "mrdamper.models.card",
    "RigRun": "mrdamper.data.records",
    "FitSettings": "mrdamper.identify.settings",
    "assess": "mrdamper.identify.fit",
    "prepare_run": "mrdamper.data.prepare",
    "read_card": "mrdamper.models.card_schema",
    "read": "mrdamper.registry.public",
    "read_runs": "mrdamper.data.readers",
}

if not TYPE_CHECKING:  # a type checker sees the imports above, and a misspelt name as an error

    def __getattr__(name: str) -> object:
        """Load a public name on first use and keep it (PEP 562)."""
        value: object
        if name == "__version__":
            from importlib.metadata import version

            value = version("mrdamper")
        elif name in _ROOM_OF:
            from importlib import import_module

            value = getattr(import_module(_ROOM_OF[name]), name)
            if name in {"Dataset", "ModelCard", "RigRun", "read_card", "read_runs"}:
                import_module("mrdamper.registry.public").bind_public()
        else:
            from mrdamper.registry import public_names

            jobs = {} if name.startswith("_") else public_names()
            if name not in jobs:  # possibly a package, which is imported then
                raise AttributeError(f"module 'mrdamper' has no attribute {name!r}")
            from mrdamper.registry.public import function_of

            value = function_of(jobs[name])
        globals()[name] = value
        return value

    def __dir__() -> list[str]:
        return sorted({*globals(), *__all__})
