"""Possible causes of the deviation of one run from the fitted model, with their thresholds and messages."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True, slots=True)
class Cause:
    """One possible cause of a deviation, with its thresholds.

    The *size* of a cause (for example a delay in seconds) is estimated for each run and compared with the
    size in comparable runs. The *deviation* of the run is the rms force that this difference explains,
    divided by the typical residual. The cause is reported only if the run exceeds all thresholds.
    """

    unit: str
    size_min: float  # min size; for a wrong command label multiplied by the command range (at least 1)
    scatter_ratio_min: float  # min deviation, divided by the scatter of the deviations of all runs
    deviation_min: float
    words: str  # message, a format string with the fields ``size`` and ``unit``
    effect: str
    remedy: str
    weight: float = 1.0  # weight in the comparison of causes; below 1 for a less common cause


# The causes are sorted from simple to complex.
CAUSES: Mapping[str, Cause] = MappingProxyType(
    {
        "force_delay": Cause(
            "s", 1.0e-3, 3.2, 0.15,
            "its force has a delay of {size:.3g} ms relative to the other runs, for example by a filter",
            "The fit describes the delay as hysteresis, so the yield displacement of the card is wrong",
            "Compare the filters and converters of this run with those of the other runs",
        ),
        "force_gain": Cause(
            "", 0.03, 2.5, 0.4,
            "its force is {size:.3f} times the force of the other runs",
            "This run changes the peak force and the viscosity of the card",
            "Check the range and amplifier of the load cell, and the current, because one run does not show "
            "which of them is wrong",
        ),
        "command_label": Cause(
            "A", 0.02, 2.5, 0.4,
            "its force equals the force of the other runs at another command, which differs by {size:+.3f} "
            "{unit} from the command of this run",
            "The force of the card is wrong near the command of this run",
            "Compare the current with the record of the current source, and check the gain of the force, "
            "because one run does not show which of them is wrong",
        ),
        "force_saturation": Cause(
            "", 0.06, 4.0, 0.4,
            "its force peaks are flatter than the peaks of the other runs, by {size:.2g} of the peak force, "
            "as with an amplifier near the end of its range",
            "Peak forces and viscosity of the card are too small",
            "Compare the range of the load cell with the peak force, and repeat the run with a larger range",
            weight=0.7,
        ),
        "force_offset_of_run": Cause(
            "N", 3.0, 6.0, 0.5,
            "its force is shifted by {size:+.4g} N relative to the force of the other runs",
            "A model without an offset cannot describe this shift, so its error is larger",
            "Zero the load cell before each run",
        ),
    }
)  # fmt: skip
