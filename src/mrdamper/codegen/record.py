"""The record of a verification: hash of the sources, inputs, machine, and differences from Python.

The record is stored next to the C files as ``verification.json``. An FMU requires such a record.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True)
class Difference:
    """The largest difference between C and Python of one output, over all samples."""

    ulp: int  # units in the last place of the number type
    relative: float  # difference divided by the value in Python
    samples_differing: int  # number of samples with different outputs
    first_sample: int | None  # index of the first such sample; None if all samples are equal


@dataclass(frozen=True, slots=True, kw_only=True)
class Verification:
    """Inputs and results of a verification."""

    passed: bool
    sources_sha256: str  # hash of the verified .c and .h files, see ``c_code.sources_sha256``
    precision: str
    samples: int
    seed: int = 0
    tolerance_relative: float = 0.0  # 0: C and Python must be bit-identical
    outputs: Mapping[str, Difference] = field(default_factory=dict)
    thermal_K: Mapping[str, float] = field(default_factory=dict)  # largest difference of each temperature
    problems: tuple[str, ...] = ()  # reasons why the verification failed
    flags_raised: Mapping[str, Mapping[str, int]] = field(default_factory=dict)  # samples with flag, by part
    compiler: str = ""
    compiler_version: str = ""
    compiler_flags: tuple[str, ...] = ()
    machine: str = ""
    stack_bytes: Mapping[str, int] = field(default_factory=dict)  # stack frame of each C function
    sizes_bytes: Mapping[str, int] = field(default_factory=dict)  # sizes of code, tables and state
    mrdamper: str = ""

    @property
    def max_ulp(self) -> int:
        """Largest difference of C and Python over all outputs, in units in the last place."""
        return max((each.ulp for each in self.outputs.values()), default=0)

    @property
    def max_relative(self) -> float:
        """Largest difference of C and Python over all outputs, divided by the value in Python."""
        return max((each.relative for each in self.outputs.values()), default=0.0)

    def as_json(self) -> dict[str, Any]:
        """Return the record as a JSON object."""
        plain = asdict(self)
        return {
            "passed": plain.pop("passed"),
            "worst_ulp": self.max_ulp,
            "worst_relative": self.max_relative,
            **{key: list(value) if isinstance(value, tuple) else value for key, value in plain.items()},
        }
