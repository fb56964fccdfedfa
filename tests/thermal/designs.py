"""Random heat sinks for the damper of the paper: number and width of fins, air speed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.drawing_file import read_drawing

DRAWING = read_drawing(Path(__file__).parents[2] / "examples" / "paper_damper.toml")


def draw_designs(count: int, seed: int) -> list[DamperDrawing]:
    """Return designs with 0 to 8 fins, 8 to 35 mm wide and 1 to 4 mm thick, in air of 0 to 4 m/s."""
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        fins, span = int(rng.integers(0, 9)), rng.uniform(0.06, 0.18)
        width, thickness = rng.uniform(0.008, 0.035), rng.uniform(0.001, 0.004)
        around = replace(DRAWING.surroundings, air_speed=rng.uniform(0.0, 4.0))
        design = replace(DRAWING, surroundings=around)
        sink = None
        if fins > 0 and DRAWING.sink is not None:
            pitch = (span - thickness) / max(fins - 1, 1)
            sink = replace(
                DRAWING.sink, fins=fins, width=width, thickness=thickness, pitch=pitch, film_multiplier=1.0
            )
        found.append(design.with_sink(sink))
    return found
