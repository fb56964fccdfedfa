"""Colours and sizes of all figures. This module does not import Matplotlib.

Colour scales are interpolated linearly between a few colours of the Matplotlib maps of the same name.
"""

from __future__ import annotations

from collections.abc import Sequence

MEASURED = "#b3b3b3"
HELD_OUT = "#c8553d"
TRAINING = "#4a6d8c"
INK = "#333333"
WIDTH_INCH = 10.6  # The page is 1130 px wide.

_VIRIDIS = (
    "440154 48186a 472d7b 424086 3b528b 33638d 2c728e 26828e 21918c "
    "1fa088 28ae80 3fbc73 5ec962 84d44b addc30 d8e219 fde725"
)
_PLASMA = (
    "0d0887 310597 4c02a1 6600a7 7e03a8 9511a1 aa2395 bc3587 cc4778 "
    "da5a6a e66c5c f0804e f89540 fdac33 fdc527 f8df25 f0f921"
)


def colour_of(command: float | None, highest: float) -> str:
    """Return the colour of a current [A] or voltage [V], dark blue at zero, ochre at the highest value."""
    share = 1.0 if command is None or highest == 0.0 else min(abs(command) / highest, 1.0)
    return _between(_VIRIDIS, 0.08 + 0.70 * share)


def colour_of_temperature(temperature: float, levels: Sequence[float]) -> str:
    """Return the colour of a temperature [degC or K] among levels, from violet (cold) to orange."""
    low, high = min(levels), max(levels)
    share = 0.5 if low == high else (temperature - low) / (high - low)
    return _between(_PLASMA, 0.05 + 0.70 * share)


def _between(scale: str, share: float) -> str:
    """Return the colour at a fraction of 0 to 1 of a scale."""
    anchors = scale.split()
    place = min(max(share, 0.0), 1.0) * (len(anchors) - 1)
    low = min(int(place), len(anchors) - 2)
    parts = [[int(each[k : k + 2], 16) for k in (0, 2, 4)] for each in anchors[low : low + 2]]
    mixed = [round(a + (place - low) * (b - a)) for a, b in zip(*parts, strict=True)]
    return "#" + "".join(f"{part:02x}" for part in mixed)


def shortened(name: str, longest: int = 40) -> str:
    """Return a name without its middle part if it is too long for a figure."""
    return name if len(name) <= longest else f"{name[: longest // 2]}...{name[-longest // 2 + 3 :]}"
