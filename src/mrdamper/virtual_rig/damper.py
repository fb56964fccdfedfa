"""Virtual dampers of either kind: presets, TOML of one's own, and dampers drawn around one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from mrdamper.errors import InputError
from mrdamper.files import read_toml
from mrdamper.schema import read_record, toml_text, unknown_name, write_record
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
"""Parameters of a virtual damper, in SI and kelvin."""

PRESETS: Mapping[str, VirtualDamper] = MappingProxyType({**LUMPED, **HYDRAULIC})

_VARIANT_SPREAD = 0.3


def find_preset(name: object) -> VirtualDamper:
    """Return a preset; an unknown name is an error that names the nearest ones."""
    if not isinstance(name, str) or name not in PRESETS:
        raise unknown_name(f"{name!r} is not a preset of the virtual rig", str(name), PRESETS)
    return PRESETS[name]


def draw_variant(damper: VirtualDamper, seed: int) -> VirtualDamper:
    """Return another damper of the same kind, its properties drawn within 30 %; its name ends in the seed.

    By agreement even seeds are for building laws and choosing constants, odd ones for reporting errors.
    """
    drawn = damper.draw(np.random.default_rng(seed), _VARIANT_SPREAD)
    return replace(drawn, name=f"{damper.name}-{seed}")


def damper_from_mapping(given: Mapping[str, Any], place: str = "virtual damper") -> VirtualDamper:
    """Return a preset with some parameters changed: ``preset`` (else nominal), ``name``, parameters.

    The name is the preset's when nothing is changed and none is given, else ``<preset>-own``.
    """
    try:
        base = find_preset(given.get("preset", "nominal"))
    except InputError as error:
        raise error.prepend_place(place) from error
    changed = {name: value for name, value in given.items() if name != "preset"}
    own = {"name": f"{base.name}-own"} if changed else {}
    return read_record(type(base), {**write_record(base, defaults=True), **own, **changed}, place)


def read_damper(path: str | Path) -> VirtualDamper:
    """Return the damper in a TOML file: ``preset = "nominal"`` and changed parameters."""
    return damper_from_mapping(read_toml(path, "virtual damper"), Path(path).name)


def find_damper(name: str | Path) -> VirtualDamper:
    """Return a preset, or the damper in a TOML file."""
    return read_damper(name) if Path(name).suffix else find_preset(str(name))


def damper_to_toml(damper: VirtualDamper) -> str:
    """Return all parameters as TOML; ``read_damper`` reads the same damper back."""
    preset = next(iter(LUMPED if isinstance(damper, LumpedDamper) else HYDRAULIC))  # any of its kind
    return toml_text(
        {"preset": preset, **write_record(damper, defaults=True)}, "a virtual damper, in SI and kelvin"
    )
