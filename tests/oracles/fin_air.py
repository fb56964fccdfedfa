"""Air flow between annular fins by finite volumes (``fin_air.c``), a reference for ``annular_fins``.

``python -m tests.oracles.fin_air 0 3 5 10`` prints computed heat-transfer coefficients in still air (0 m/s)
at gaps of 3, 5 and 10 mm, the grid error, and the correlations. Each gap takes half a minute. ``TUBE/OUTER``
after the speed sets the diameters of the fins in millimetres (``0 30/90 3``).
"""

from __future__ import annotations

import math
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.thermal.films.air import GRAVITY_M_S2, air_at
from mrdamper.thermal.films.annular_fins import forced_side_film, nusselt_annular_fins
from tests.oracles.programs import run_program

__all__ = ["FinAir", "compute_fin_air", "law_of", "settle_fin_air"]

_AMBIENT_K = 293.15
_ALONG, _AROUND, _BEYOND, _DEEP = (
    10,
    12,
    12,
    0.5e-3,
)  # Cells of the coarsest grid: along the fin, around the tube, outside, and cell size in the gap [m]
_FAR, _CROWDED, _BARE = (
    0.2,
    1.8,
    0.8e-3,
)  # Outer radius of the air [m], refinement at tube and rim [-], first cell on a bare tube [m]


@dataclass(frozen=True, slots=True)
class FinAir:
    """Heat-transfer coefficients divided by the thermal conductivity of the air [1/m], and their errors."""

    sides: float
    floor: float
    rim: float
    drift: float  # Relative change between the third and the fourth quarter of the simulated time [-]
    mean: float  # Area mean of fin sides and tube between the fins, or of a bare tube
    doubt: float = math.nan  # Relative error of ``mean`` caused by the grid [-]


def settle_fin_air(folder: Path, gap: float, **given: float) -> FinAir:
    """Return heat-transfer coefficients extrapolated to cell size zero (Richardson extrapolation).

    The fine one of two grids has half the cell size. Errors are proportional to the squared cell size (order
    1.9 on three grids at 3 mm). The error of the fine grid is therefore a third of the difference between the
    grids. The stated error is 1.25 times this error, as in the grid convergence index.
    """
    rough, fine = (compute_fin_air(folder, gap, fine=each, **given) for each in (1, 2))
    sides, floor, rim, mean = (
        getattr(fine, name) + (getattr(fine, name) - getattr(rough, name)) / 3.0
        for name in ("sides", "floor", "rim", "mean")
    )
    return FinAir(sides, floor, rim, fine.drift, mean, 1.25 * abs(mean / fine.mean - 1.0))


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
    fine: int = 2,
) -> FinAir:
    """Return the heat-transfer coefficients of isothermal fins on a horizontal tube in steady laminar air.

    Parameters
    ----------
    folder : folder of the compiled program, which is compiled if it is missing
    gap, tube, outer, thickness : dimensions of the fins [m]; ``outer`` below ``tube`` is a bare tube
    wind : air speed along y [m/s]; 0 is still air with natural convection
    seconds : simulated time until the flow is steady [s]
    fine : number of cells divided by the number of the coarsest grid, in each direction
    """
    air = air_at(_AMBIENT_K + 0.5 * excess_K)
    nu = float(air.kinematic_viscosity)
    diffusivity, lift = nu / float(air.prandtl), GRAVITY_M_S2 * excess_K / float(air.temperature)
    half = max(round(0.5 * gap / _DEEP), 1)
    deep, finned = 0.5 * gap / (half * fine), outer > tube
    fin = max(round(0.5 * thickness * half / (0.5 * gap)), 1) * fine if finned else 0
    radii = _radii(0.5 * tube, 0.5 * max(outer, tube), fine)
    # The artificial speed of sound is a multiple of the flow speed.
    sound, fast = (3.0 * wind, 1.5 * wind) if wind > 0.0 else (0.8, 0.4)
    least, arc = float(np.diff(radii).min()), 0.5 * tube * math.pi / (_AROUND * fine)
    step = 0.8 / (sound * math.hypot(1.0 / deep, 1.0 / least, 1.0 / arc) + fast * (0.5 / least + 1.0 / arc))
    step = min(step, 0.2 / (diffusivity * (deep**-2 + least**-2)))
    count = round((seconds or (0.8 / wind if wind > 0.0 else 5.0)) / step)
    head = (
        len(radii) - 1, _AROUND * fine, half * fine + fin, deep, _ALONG * fine if finned else 0, fin,
        nu, diffusivity, 0.0 if wind > 0.0 else lift, sound, wind, count, step,
    )  # fmt: skip
    numbers = " ".join(map(repr, [*head, *radii.tolist()]))
    done = subprocess.run([_program(folder)], input=numbers, capture_output=True, text=True, check=True)
    (sides, drift), (floor, other), (rim, _), _ = (
        tuple(map(float, line.split())) for line in done.stdout.splitlines()
    )
    areas = math.pi * (outer**2 - tube**2) / 4.0 if finned else 0.0, math.pi * tube * 0.5 * gap
    mean = (areas[0] * sides + areas[1] * floor) / sum(areas)
    return FinAir(sides, floor, rim, abs(drift if finned else other), mean)


def _program(folder: Path) -> Path:
    program = folder / "fin_air"
    if not program.exists():
        source = Path(__file__).with_name("fin_air.c")
        told = ["-O3", "-ffast-math", "-march=native", "-mprefer-vector-width=256", "-o", str(program)]
        run_program("cc", [*told, str(source), "-lm"], folder, package="gcc")
    return program


def _radii(inner: float, outer: float, fine: int) -> FloatArray:
    """Return the radii of the cell faces [m]. Cells are narrow at tube and rim and grow steadily outside."""
    along, beyond, slope = _ALONG * fine, _BEYOND * fine, _BARE * _BEYOND
    fin = np.array([inner])
    if outer > inner:
        share = np.tanh(_CROWDED * np.linspace(-1.0, 1.0, along + 1)) / math.tanh(_CROWDED)
        fin = inner + (outer - inner) * (0.5 + 0.5 * share)
        slope = (outer - inner) * _CROWDED / math.cosh(_CROWDED) ** 2 / math.tanh(_CROWDED) * _BEYOND / _ALONG
    # With ``slope``, the cells on both sides of the rim are nearly equally wide. The bisection finds the
    # exponential growth of the outer cells for which the last face is at ``_FAR``.
    low, high = 0.1, 12.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if slope / middle * math.expm1(middle) < _FAR - outer else (low, middle)
    far = outer + slope / low * np.expm1(low * np.arange(1, beyond + 1) / beyond)
    return np.concatenate([fin, far])


def law_of(
    gap: float, wind: float, tube: float = 0.046, outer: float = 0.092, excess_K: float = 60.0
) -> float:
    """Return the correlation divided by the conductivity of air [1/m], in still air including the tube."""
    air = air_at(_AMBIENT_K + 0.5 * excess_K)
    if wind > 0.0:
        return float(forced_side_film(wind, gap, tube, outer, air.kinematic_viscosity, air.prandtl))
    return float(nusselt_annular_fins(air.rayleigh(gap, excess_K) * gap / outer, outer / tube)) / gap


def _print_table(folder: Path, wind: float, gaps: Sequence[float], tube: float, outer: float) -> None:
    """Print computed coefficients, coefficients of the correlation, and errors of the correlation."""
    for gap in gaps:
        found, law = (
            settle_fin_air(folder, gap, wind=wind, tube=tube, outer=outer),
            law_of(gap, wind, tube, outer),
        )
        seen = found.sides if wind > 0.0 else found.mean
        print(
            f"{wind:g} m/s, {1e3 * gap:g} mm: computed {seen:.1f} (grid {found.doubt:.1%}), law {law:.1f}, "
            f"{law / seen - 1.0:+.0%}; floor {found.floor:.0f}, rim {found.rim:.0f}",
            flush=True,
        )


if __name__ == "__main__":
    speed, *words = sys.argv[1:]
    fins = [1e-3 * float(each) for each in (words.pop(0) if "/" in words[0] else "46/92").split("/")]
    with tempfile.TemporaryDirectory() as place:
        _print_table(Path(place), float(speed), [1e-3 * float(each) for each in words], *fins)
