"""The record of a check: which sources were run where, over what, and how far they were from Python.

It lies beside the C files as ``verification.json``, and an FMU is made only from sources that one holds for.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True)
class Difference:
    """The worst of one output over all samples."""

    ulp: int  # in units in the last place of the target's number type
    relative: float  # to the value in Python
    samples_differing: int
    first_sample: int | None  # that differs


@dataclass(frozen=True, slots=True, kw_only=True)
class Verification:
    """What was run and what came out. ``samples`` of 0: nothing was, because it was asked not to be."""

    passed: bool
    sources_sha256: str  # of the .c and .h files, ``c_code.sources_sha256``
    precision: str
    samples: int = 0
    seed: int = 0
    tolerance_relative: float = 0.0  # 0: the same bits
    outputs: Mapping[str, Difference] = field(default_factory=dict)
    thermal_K: Mapping[str, float] = field(
        default_factory=dict
    )  # output of the thermal model -> off the host
    problems: tuple[str, ...] = ()  # why it did not pass
    covered: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # lowest and highest input
    readings_not_finite: int = 0
    flags_raised: Mapping[str, Mapping[str, int]] = field(default_factory=dict)  # part -> flag -> samples
    compiler: str = ""
    compiler_version: str = ""
    compiler_flags: tuple[str, ...] = ()
    machine: str = ""
    stack_bytes: Mapping[str, int] = field(default_factory=dict)  # function -> its own frame
    sizes_bytes: Mapping[str, int] = field(default_factory=dict)  # code, tables, state
    mrdamper: str = ""

    @property
    def worst_ulp(self) -> int:
        """The largest difference of any output, in units in the last place."""
        return max((each.ulp for each in self.outputs.values()), default=0)

    @property
    def worst_relative(self) -> float:
        """The largest difference of any output, relative to the value in Python."""
        return max((each.relative for each in self.outputs.values()), default=0.0)

    def as_json(self) -> dict[str, Any]:
        """Return the record as one JSON object."""
        plain = asdict(self)
        return {
            "passed": plain.pop("passed"),
            "verified": self.samples > 0,
            "worst_ulp": self.worst_ulp,
            "worst_relative": self.worst_relative,
            **{key: list(value) if isinstance(value, tuple) else value for key, value in plain.items()},
        }
