"""The record of a verification: sources, inputs, machine, and differences to Python.

It is stored next to the C files as ``verification.json``. Only verified sources become an FMU.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True)
class Difference:
    """The largest difference of one output over all samples."""

    ulp: int  # units in the last place of the target's number type
    relative: float  # difference divided by the value in Python
    samples_differing: int
    first_sample: int | None  # first different sample


@dataclass(frozen=True, slots=True, kw_only=True)
class Verification:
    """Inputs and results of a verification."""

    passed: bool
    sources_sha256: str  # hash of the .c and .h files, ``c_code.sources_sha256``
    precision: str
    samples: int
    seed: int = 0
    tolerance_relative: float = 0.0  # 0: the same bits
    outputs: Mapping[str, Difference] = field(default_factory=dict)
    thermal_K: Mapping[str, float] = field(default_factory=dict)  # output of the thermal model -> difference
    problems: tuple[str, ...] = ()  # why it did not pass
    flags_raised: Mapping[str, Mapping[str, int]] = field(default_factory=dict)  # part -> flag -> samples
    compiler: str = ""
    compiler_version: str = ""
    compiler_flags: tuple[str, ...] = ()
    machine: str = ""
    stack_bytes: Mapping[str, int] = field(default_factory=dict)  # function -> its own frame
    sizes_bytes: Mapping[str, int] = field(default_factory=dict)  # code, tables, state
    mrdamper: str = ""

    @property
    def max_ulp(self) -> int:
        """The largest difference of any output, in units in the last place."""
        return max((each.ulp for each in self.outputs.values()), default=0)

    @property
    def max_relative(self) -> float:
        """The largest difference of any output, relative to the value in Python."""
        return max((each.relative for each in self.outputs.values()), default=0.0)

    def as_json(self) -> dict[str, Any]:
        """Return the record as one JSON object."""
        plain = asdict(self)
        return {
            "passed": plain.pop("passed"),
            "worst_ulp": self.max_ulp,
            "worst_relative": self.max_relative,
            **{key: list(value) if isinstance(value, tuple) else value for key, value in plain.items()},
        }
