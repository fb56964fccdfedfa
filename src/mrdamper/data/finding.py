"""Findings (faults, warnings and notes), and values that were inferred from words."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, asdict, dataclass, replace
from typing import Literal

from mrdamper.quantities import QUANTITIES, to_degC

Severity = Literal["fault", "warning", "note"]
SEVERITIES: tuple[Severity, ...] = ("fault", "warning", "note")
"""Fault: the run must not be fitted as it is. Warning: the fit, or a held-out error, is less accurate.
Note: information only."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One finding. ``found``, ``effect`` and ``remedy`` are for the user, the other fields for scripts."""

    kind: str  # A stable name such as "clipped" or "force_sign".
    found: str
    effect: str  # Effect on a fit.
    remedy: str
    _: KW_ONLY
    severity: Severity = "warning"
    channel: str = ""  # Role, such as "force"; "" if the finding concerns the whole run.
    size: float | None = None  # Size in ``unit``.
    unit: str = ""
    low: float | None = None  # The true size is between ``low`` and ``high``.
    high: float | None = None
    from_s: float | None = None  # The fault is between ``from_s`` and ``to_s`` of the run.
    to_s: float | None = None
    run: str = ""  # Name; "" if the finding concerns the whole campaign.

    def add_interval(self, error: float) -> Finding:
        """Add the interval of the size: plus or minus two standard errors ``error``."""
        assert self.size is not None
        return replace(self, low=self.size - 2.0 * error, high=self.size + 2.0 * error)

    def between(self, from_s: float, to_s: float) -> Finding:
        """Add the time span [s] of the fault."""
        return replace(self, from_s=float(from_s), to_s=float(to_s))

    def to_dict(self) -> Mapping[str, str | float | None]:
        """Return the fields as JSON values."""
        names = {"low": "size_low", "high": "size_high"}
        named = {names.get(key, key): value for key, value in asdict(self).items()}
        order = dict.fromkeys(("kind", "severity", "channel"))
        return order | named | {"channel": self.channel or None, "unit": self.unit or None}

    def in_words(self) -> str:
        """Return the finding as one line."""
        return f"{self.found}. {self.effect}. {self.remedy}."


@dataclass(frozen=True, slots=True)
class Inference:
    """A value [SI] that was read from words, with its run and role, and the source of the words."""

    run: str
    role: str
    value: float
    source: str

    def in_words(self) -> str:
        """Return the inference as one line."""
        value = f"{self.value:g} {QUANTITIES[self.role].unit}"
        if self.role == "temperature":
            value = f"{to_degC(self.value):g} degC"
        return f"{self.run}: {self.role} {value}, from the {self.source}"


def no_run(name: str, reason: str, severity: Severity = "note") -> Finding:
    """Return the finding that a file, or a part of a file, is not read as a run."""
    found = f"{name} {reason} and is not read as a run"
    effect = "Only its statements about runs are used"
    remedy = "Read this file alone to see why it is not a run"
    return Finding("no_run", found, effect, remedy, severity=severity, run=name)


def by_kind(findings: Sequence[Finding]) -> list[tuple[Finding, int]]:
    """Return (largest finding by size, number of runs) of each severity, kind and channel.

    The worst severity is first. Runs that are copies of other runs are not counted. The number of runs is 0
    if the finding concerns the whole campaign.
    """
    copies = {finding.run for finding in findings if finding.kind == "duplicate"}
    groups: dict[tuple[str, str, str], list[Finding]] = {}
    for finding in sorted(findings, key=severity_rank):
        groups.setdefault((finding.severity, finding.kind, finding.channel), []).append(finding)
    found = []
    for (_, kind, _), group in groups.items():
        runs = {finding.run for finding in group if finding.run}
        count = len(runs if kind == "duplicate" else runs - copies) or min(len(runs), 1)
        found.append((max(group, key=lambda finding: abs(finding.size or 0.0)), count))
    return found


def without_repeats(findings: Iterable[Finding]) -> list[Finding]:
    """Return the first finding of each kind in each run, channel and time span, worst first."""
    first: dict[tuple[object, ...], Finding] = {}
    for finding in sorted(findings, key=severity_rank):
        key = (finding.run, finding.kind, finding.channel, finding.from_s, finding.to_s)
        first.setdefault(key if finding.run else (*key, finding.found), finding)
    return list(first.values())


def percent(share: float) -> str:
    """Return a ratio as text in percent: two significant digits below 10 %, else no decimals."""
    return f"{100 * share:.0f} %" if abs(share) >= 0.1 else f"{100 * share:.2g} %"


def severity_rank(finding: Finding) -> int:
    """Return a sort key: faults, then warnings, then notes."""
    return SEVERITIES.index(finding.severity)
