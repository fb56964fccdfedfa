"""Air between annular fins by finite volumes (``fin_air.c``): the laws of ``annular_fins`` are held to it.

``python -m tests.oracles.fin_air 0 5 10`` prints what it finds in still air (0 m/s) at gaps of 5 and 10 mm,
and what the laws say; a gap takes a minute.
"""

from __future__ import annotations

import math
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mrdamper.thermal.films.air import GRAVITY, air_at
from mrdamper.thermal.films.annular_fins import forced_side_film, nusselt_annular_fins
from tests.oracles.programs import run_program

__all__ = ["FinAir", "compute_fin_air"]

_AMBIENT_K = 293.15
_CELL, _DEEP, _WIDEST, _GROWTH = 2e-3, 0.25e-3, 8e-3, 1.15  # cells across, along the tube, far away [m]
_BESIDE, _ABOVE, _BELOW = 0.14, 0.20, 0.11  # of the tube: how far the air reaches [m]


@dataclass(frozen=True, slots=True)
class FinAir:
    """Films over the air's conductivity [1/m], and how settled they are."""

    sides: float
    floor: float
    rim: float
    drift: float  # between the means over the last two quarters of the time, of the largest film's part [-]


def compute_fin_air(
    folder: Path,
    gap: float,
    *,
    tube: float = 0.046,
    outer: float = 0.092,
    thickness: float = 1e-3,
    wind: float = 0.0,
    excess_K: float = 60.0,
    seconds: float | None = None,
) -> FinAir:
    """Return what steady laminar air takes from isothermal fins on a horizontal tube.

    Parameters
    ----------
    folder : for the program, compiled where it is not there yet
    gap, tube, outer, thickness : of the fins [m]; ``outer`` below ``tube`` is a bare tube
    wind : of the air along y [m/s]; 0 is still air, which rises
    seconds : that the flow is given to settle
    """
    program = folder / "fin_air"
    if not program.exists():
        source = Path(__file__).with_name("fin_air.c")
        run_program(
            "cc",
            ["-O3", "-ffast-math", "-march=native", "-o", str(program), str(source), "-lm"],
            folder,
            package="gcc",
        )
    air = air_at(_AMBIENT_K + 0.5 * excess_K)
    nu = float(air.kinematic_viscosity)
    diffusivity, lift = nu / float(air.prandtl), GRAVITY * excess_K / float(air.temperature)
    deep, fin = round(0.5 * (gap + thickness) / _DEEP), round(0.5 * thickness / _DEEP)
    x, up, down = (_cells(0.5 * max(outer, tube) + 6e-3, far) for far in (_BESIDE, _ABOVE, _BELOW))
    sound = (
        3.0 * wind if wind > 0.0 else 1.2
    )  # of the artificial compressibility, some times the flow's speed
    step = 0.8 / (sound * math.sqrt(_DEEP**-2 + 2.0 * _CELL**-2) + 2.0 * (wind or 0.4) / _CELL)
    step = min(step, 0.25 * _DEEP**2 / diffusivity)
    count = round((seconds or (0.3 if wind > 0.0 else 4.0)) / step)
    head = (
        len(x), len(down) + len(up), deep, _DEEP, fin if outer > tube else 0, 0.5 * tube, 0.5 * outer,
        nu, diffusivity, 0.0 if wind > 0.0 else lift, sound, wind, count, step,
    )  # fmt: skip
    numbers = [*head, *x, *down[::-1], *up, -sum(down)]
    done = subprocess.run(
        [program], input=" ".join(map(repr, numbers)), capture_output=True, text=True, check=True
    )
    sides, floor, rim = (tuple(map(float, line.split())) for line in done.stdout.splitlines())
    return FinAir(sides[0], floor[0], rim[0], max(abs(sides[1]), abs(floor[1]) if outer <= tube else 0.0))


def _cells(core: float, far: float) -> list[float]:
    """Return cell sizes from the middle outwards [m]: even over the core, then growing."""
    cells = [_CELL] * round(core / _CELL)
    while math.fsum(cells) < far:
        cells.append(min(cells[-1] * _GROWTH, _WIDEST))
    return cells


def _print_table(folder: Path, wind: float, gaps: Sequence[float]) -> None:
    """Print films over the air's conductivity [1/m]: computed, by the law, and how far the law is off."""
    tube, outer, excess = 0.046, 0.092, 60.0
    air = air_at(_AMBIENT_K + 0.5 * excess)
    for gap in gaps:
        found = compute_fin_air(folder, gap, wind=wind)
        if wind > 0.0:
            law = float(forced_side_film(wind, gap, tube, outer, air.kinematic_viscosity, air.prandtl))
            seen = found.sides
        else:
            sides, floor = math.pi * (outer**2 - tube**2) / 4.0, math.pi * tube * 0.5 * gap
            seen = (sides * found.sides + floor * found.floor) / (sides + floor)
            rayleigh = air.rayleigh(gap, excess) * gap / outer
            law = float(nusselt_annular_fins(rayleigh, outer / tube)) / gap
        off = f"{law / seen - 1.0:+.0%}"
        print(f"{wind:g} m/s, {1e3 * gap:g} mm: computed {seen:.0f}, law {law:.0f}, {off}", flush=True)


if __name__ == "__main__":
    speed, *widths = map(float, sys.argv[1:])
    with tempfile.TemporaryDirectory() as place:
        _print_table(Path(place), speed, [1e-3 * each for each in widths])
