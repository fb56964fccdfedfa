"""Find copied runs and runs of another damper without reading the samples.

Only the values in the table of runs (stroke, force range, ...) are compared, because a server must answer
fast. The job ``check`` compares the samples.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from statistics import median_high

from mrdamper.schema import Json

_SPEED_DIFFERENCE_MAX = 0.1  # max relative difference of the speeds of similar runs
_SIMILAR_COUNT_MIN = 3  # min number of similar runs for a comparison
_FORCE_RATIO_MAX = 2.0  # A run with a larger (or inverse) ratio to the median force is reported.
_MEASURED = (
    *("command_unit", "command_range", "samples", "rate_Hz"),
    *("stroke_mm", "peak_velocity_mm_s", "force_range_N"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Row:
    """Main values of a run that are compared. The fields have the names of the table columns."""

    name: str
    error: str | None
    motion: str | None
    command: float | None
    command_unit: str | None
    temperature_degC: float | None
    peak_velocity_mm_s: float | None
    force_range_N: tuple[float, float] | None

    @property
    def force_span_N(self) -> float:
        """Return the difference of largest and smallest force, NaN for a run that was not read."""
        if self.error or self.force_range_N is None:
            return math.nan
        return self.force_range_N[1] - self.force_range_N[0]


def compare_rows(rows: Sequence[Json]) -> list[Json]:
    """Add two fields to the row of each run; return the new rows.

    ``copy_of`` is the name of an equal run. ``foreign`` is the reason why the run probably belongs to another
    damper. None: there is no such run or reason.
    """
    values = [_Row(**{each.name: row[each.name] for each in fields(_Row)}) for row in rows]
    first: dict[str, str] = {}
    foreign = dict(_foreign(values))
    compared = []
    for k, (row, value) in enumerate(zip(rows, values, strict=True)):
        key = str([row[name] for name in _MEASURED])
        compared.append({**row, "copy_of": first.get(key), "foreign": foreign.get(k)})
        if not math.isnan(value.force_span_N):
            first.setdefault(key, value.name)
    return compared


def _foreign(rows: Sequence[_Row]) -> Iterator[tuple[int, str]]:
    """Generate index and reason of each run that probably belongs to another damper."""
    units = Counter(row.command_unit for row in rows if row.command_unit)
    usual = max(units, key=units.__getitem__, default=None)
    groups: dict[tuple[object, ...], list[tuple[int, float, float]]] = defaultdict(list)
    for k, row in enumerate(rows):
        if row.command_unit not in {None, "", usual}:
            yield k, f"commanded in {row.command_unit}, most runs are in {usual}"
        elif row.peak_velocity_mm_s and not math.isnan(row.force_span_N):
            key = (
                row.motion,
                None if row.command is None else round(row.command, 2),
                None if row.temperature_degC is None else round(row.temperature_degC / 5.0),
            )
            groups[key].append((k, row.peak_velocity_mm_s, row.force_span_N))
    for group in groups.values():
        for k, speed, span_N in group:
            others_N = [
                other_N
                for j, other_speed, other_N in group
                if j != k and abs(other_speed / speed - 1.0) <= _SPEED_DIFFERENCE_MAX
            ]
            ratio = span_N / (median_high(others_N) or 1.0) if len(others_N) >= _SIMILAR_COUNT_MIN else 1.0
            if not 1.0 / _FORCE_RATIO_MAX <= ratio <= _FORCE_RATIO_MAX:
                yield k, f"its force is {ratio:.2g} times the force of similar runs"
