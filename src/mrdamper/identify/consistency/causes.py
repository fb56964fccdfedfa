"""What can be wrong with one run of a campaign: how each cause is told, and from which size on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from mrdamper.data.prepare import PreparedRun

_OF_PERIOD = 0.002  # the smallest delay that is told, 1 ms at 2 Hz


@dataclass(frozen=True, slots=True)
class Cause:
    """One thing that can be wrong with a run, how it is told, and when.

    ``least`` is the smallest size that is told, ``clear`` by how many times the scatter of the other runs a
    run must leave them, and ``strength`` by how much of the usual residual.
    """

    kind: str
    unit: str
    least: float
    clear: float
    strength: float
    words: str
    effect: str
    remedy: str
    plain: float = 1.0  # weight among causes that explain a run: the plainer one is told


_LEVEL = "Peak force and viscosity of the card are pulled towards this run's"
CAUSES: Mapping[str, Cause] = MappingProxyType(
    {
        each.kind: each
        for each in (
            Cause(
                "force_delay", "s", 1.0e-3, 3.2, 0.15,
                "its force comes {0:.3g} ms later than the other runs', by a delay or a filter",
                "A delay is taken for hysteresis: the yield displacement comes out wrong",
                "Compare filters and converters of this file with the others'",
            ),
            Cause(
                "force_gain", "-", 0.03, 2.5, 0.4,
                "its force is {0:.3f} times that of the other runs", _LEVEL,
                "Check range and amplifier of the load cell in this file",
            ),
            Cause(
                "command_label", "A", 0.02, 2.5, 0.4,
                "its force is that of a command {0:+.3f} {1} away from its label",
                "The force over command of the card is bent at this run's command",
                "Check the current of this file against the source's record",
            ),
            Cause(
                "force_saturation", "-", 0.06, 4.0, 0.4,
                "its force bends away from the other runs' by {0:.2g} of its peak, as an amplifier "
                "does near its end",
                "Peak forces and viscosity of the card come out too small",
                "Compare the load cell's range with the peak force, and record again with a larger one",
                plain=0.7,
            ),
            Cause(
                "force_offset_of_run", "N", 3.0, 6.0, 0.5,
                "its force is shifted by {0:+.4g} N against the other runs",
                "A law without an offset leaves it in its error",
                "Zero the load cell, or let sessions have offsets of their own (⟦--session-offsets⟧)",
            ),
        )
    }
)  # fmt: skip


def least_told(cause: Cause, runs: Sequence[PreparedRun], number: int) -> float:
    """Return the smallest size that is told of a run: of a command by its range, of a delay by the period."""
    if cause.kind == "command_label":  # stated for a range of 1 A
        commands = [run.run.constant_command or 0.0 for run in runs]
        return cause.least * max(max(commands) - min(commands), 1.0)
    if cause.kind == "force_delay":  # a slow motion hardly tells a delay from the law's own error
        return max(cause.least, _OF_PERIOD * (runs[number].period_s or 0.0))
    return cause.least
