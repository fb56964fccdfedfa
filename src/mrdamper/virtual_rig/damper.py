"""Virtual dampers of both kinds (lumped and hydraulic): presets, TOML files, and random variants."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from mrdamper.errors import InputError
from mrdamper.files import read_toml, toml_text
from mrdamper.schema import read_record, unknown_name, write_record
from mrdamper.virtual_rig.hydraulic import HYDRAULIC, HydraulicDamper
from mrdamper.virtual_rig.lumped import LUMPED, LumpedDamper

__all__ = [
    "PRESETS",
    "HydraulicDamper",
    "LumpedDamper",
    "VirtualDamper",
    "damper_from_mapping",
    "damper_to_toml",
    "draw_variant",
    "find_damper",
    "find_preset",
    "read_damper",
]

VirtualDamper = LumpedDamper | HydraulicDamper
"""Parameters of a virtual damper of either kind, in SI units and kelvin."""

PRESETS: Mapping[str, VirtualDamper] = MappingProxyType({**LUMPED, **HYDRAULIC})

_VARIANT_SPREAD = 0.3


def find_preset(name: object) -> VirtualDamper:
    """Return the preset with a name; raise InputError with similar names if the name is unknown."""
    if not isinstance(name, str) or name not in PRESETS:
        raise unknown_name(f"{name!r} is not a preset of the virtual rig", str(name), PRESETS)
    return PRESETS[name]


def draw_variant(damper: VirtualDamper, seed: int) -> VirtualDamper:
    """Return a random variant of a damper, with parameters changed by up to 30 %.

    The name of the variant ends with the seed. By convention, even seeds are used to develop laws and to
    choose constants, and odd seeds are used to report errors.
    """
    drawn = damper.draw(np.random.default_rng(seed), _VARIANT_SPREAD)
    return replace(drawn, name=f"{damper.name}-{seed}")


def damper_from_mapping(given: Mapping[str, Any], place: str = "virtual damper") -> VirtualDamper:
    """Return a preset with changed parameters.

    The keys of ``given`` are ``preset`` (default: nominal), ``name`` and names of parameters. The default
    name of the damper is ``<preset>-own``, or the name of the preset if no parameter is changed.
    """
    try:
        base = find_preset(given.get("preset", "nominal"))
    except InputError as error:
        raise error.prepend_place(place) from error
    changed = {name: value for name, value in given.items() if name != "preset"}
    own = {"name": f"{base.name}-own"} if changed else {}
    return read_record(type(base), {**write_record(base, defaults=True), **own, **changed}, place)


def read_damper(path: str | Path) -> VirtualDamper:
    """Return the damper in a TOML file, which contains a ``preset`` and changed parameters."""
    return damper_from_mapping(read_toml(path, "virtual damper"), Path(path).name)


def find_damper(name: str | Path) -> VirtualDamper:
    """Return the preset with this name, or the damper in the TOML file with this path."""
    return read_damper(name) if Path(name).suffix else find_preset(str(name))


def damper_to_toml(damper: VirtualDamper) -> str:
    """Return all parameters as TOML text. ``read_damper`` reads an equal damper from this text."""
    # The preset in the text only determines the kind of damper, because all parameters are written.
    preset = next(iter(LUMPED if isinstance(damper, LumpedDamper) else HYDRAULIC))
    return toml_text(
        {"preset": preset, **write_record(damper, defaults=True)}, "a virtual damper, in SI and kelvin"
    )
