"""Findings on force and displacement of one damper: sign, offset, drift, delay.

A passive damper dissipates energy: its force and its velocity have the same sign on average, and its force
never leads its velocity.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from mrdamper.data.cycles import cycles
from mrdamper.data.diagnosis.repeatability import drift, estimate_lag
from mrdamper.data.diagnosis.settings import SETTINGS
from mrdamper.data.finding import Finding, percent
from mrdamper.data.prepare import PreparedRun


def find_force_offset(prepared: PreparedRun) -> Iterator[Finding]:
    """Generate a finding if the command is constant and the mean force over whole cycles is not zero."""
    offset = _static_force(prepared)
    if offset is None or prepared.run.constant_command is None:
        return
    spread = float(np.std(prepared.force[prepared.scored_from :]))
    limit = SETTINGS.force_offset_ratio_max * spread
    if abs(offset) <= (limit if prepared.period_s is not None else 2.0 * limit):
        return
    share = percent(abs(offset) / spread)
    found = f"force has an offset of {offset:+.4g} N ({share} of its standard deviation)"
    effect = "A law without an offset keeps it as an error, and fits a part of it as asymmetry"
    remedy = "Zero the load cell. Keep the offset if its cause is a gas preload (fit a law with an offset) "
    remedy += "or a damper that is stronger in one direction (the offset grows with the force; fit the "
    remedy += "asymmetries of chain)"
    found_offset = Finding("force_offset", found, effect, remedy, channel="force", size=offset, unit="N")
    yield found_offset if abs(offset) > 2.0 * limit else replace(found_offset, severity="note")


def find_drift(prepared: PreparedRun) -> Iterator[Finding]:
    """Generate findings on drift from the first to the last cycle: mean position, mean force, force range."""
    found = drift(prepared)
    whole = cycles(prepared)
    if found is None or len(whole) < 3 or prepared.run.constant_command is None:
        return
    stroke = float(np.median(whole.stroke_m))
    span = float(np.ptp(prepared.force[whole.row[0] : whole.end[-1]]))
    ends = prepared.run.time[0] + prepared.trajectory.step * np.array([whole.row[0], whole.end[-1]])
    cycle_words = f"from the first to the last of {len(whole)} cycles"
    if abs(size := found.displacement_m) > SETTINGS.drift_ratio_max * stroke:
        words = f"mean displacement moves by {1e3 * size:+.3g} mm {cycle_words} "
        words += f"({percent(abs(size) / stroke)} of its range)"
        effect = "A stiffness turns the drift into a force that was not measured"
        remedy = "Use a law without stiffness, or Preparation(reference='mean'), or a shorter segment"
        moved = Finding("position_drift", words, effect, remedy, channel="displacement", size=size, unit="m")
        yield moved.between(*ends)
    if abs(size := found.force_N) > SETTINGS.drift_ratio_max * span:
        words = f"mean force moves by {size:+.3g} N {cycle_words} ({percent(abs(size) / span)} of its range)"
        effect = "A constant offset cannot follow the drift, which remains as an error"
        remedy = "Let the load cell and its amplifier warm up; take a shorter segment"
        moved = Finding("force_drift", words, effect, remedy, channel="force", size=size, unit="N")
        yield moved.between(*ends)
    if abs(size := found.spread_percent) > SETTINGS.force_range_change_max_percent:
        words = f"the range of force {'grows' if size > 0 else 'falls'} by {abs(size):.2g} % {cycle_words}"
        error = f"{0.3 * abs(size):.2g} % of error"
        effect = f"A model at one temperature can only follow the middle: about {error} remain"
        remedy = "Record the temperature with the run, or take the segment after the damper has settled"
        changed = Finding("force_level_changes", words, effect, remedy, channel="force", size=size, unit="%")
        yield changed.between(*ends)


def find_force_lag(prepared: PreparedRun) -> Iterator[Finding]:
    """Generate a finding if the force leads the velocity, or lags by more than hysteresis can explain.

    A small lag and hysteresis cannot be distinguished in a single run. A leading force is always a fault.
    """
    if prepared.period_s is None or len(cycles(prepared)) < 2:
        return
    step, period = prepared.trajectory.step, prepared.period_s
    lag = estimate_lag(prepared, period)
    early = lag < -max(1.5 * step, SETTINGS.force_lead_max_periods * period)
    if not early and lag < SETTINGS.force_lag_max_periods * period:
        return
    effect = "A delay is taken for hysteresis: the yield displacement comes out too large"
    remedy = "Compare the delays of the two channels (filters, converters)"
    if early:
        effect = "The loop opens on the wrong side, which no passive law does"
        remedy += " and shift one; a mass between load cell and damper does the same at high frequency"
    else:
        remedy += "; if there is none, the damper is elastic"
    found = f"force comes {1e3 * abs(lag):.3g} ms {'before' if early else 'after'} the velocity "
    found += f"({percent(abs(lag) / period)} of the period)"
    kind = "force_early" if early else "force_late"
    yield Finding(kind, found, effect, remedy, channel="force", size=lag, unit="s")


def _static_force(prepared: PreparedRun) -> float | None:
    """Return the static force [N], None if the run has no whole cycle.

    The static force of a periodic motion is the mean force over whole cycles. For other motions, the force is
    fitted as a + b sign(v) + c v + d (x - mean of x), and a is the static force.
    """
    whole = cycles(prepared)
    if not len(whole):
        return None
    kept = slice(whole.row[0], whole.end[-1])
    force, velocity = prepared.force[kept], prepared.trajectory.velocity[kept]
    if prepared.period_s is not None:
        return float(np.mean(force))
    x = prepared.trajectory.displacement[kept]
    terms = np.column_stack([np.ones_like(x), np.sign(velocity), velocity, x - x.mean()])
    return float(np.linalg.lstsq(terms, force, rcond=None)[0][0])
