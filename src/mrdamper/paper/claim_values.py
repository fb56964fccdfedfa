"""Functions that compute the simulated values of the claims from the results of the demo."""

from __future__ import annotations

from typing import Literal

import numpy as np

from mrdamper.control.score import Score
from mrdamper.excitation import Sine, motion_from_text
from mrdamper.identify.assess import Assessment
from mrdamper.identify.scores import RunError
from mrdamper.models.fluids.fluid import fall_percent
from mrdamper.paper.claims import Findings
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.thermal.temperature_rise import Rise

HALF_HOUR_S, LIMIT_TEST_S = 1800.0, 2100.0
_PAPER_ERROR_RATIO = 62.5 / 900.0  # maximum control error in the paper, divided by the target force
_STILL_AIR_W_m2K = 15.0  # upper bound of the heat-transfer coefficient of a damper without fins in still air

# ------------------------------------------------------------------------ values of the tests and the fluid


def speed_mm_s(motion: str) -> float:
    """Return the maximum speed of a sine that is given as text [mm/s]."""
    sine = motion_from_text(motion)
    assert isinstance(sine, Sine)
    return 2e3 * np.pi * sine.frequency * sine.amplitude


def largest_stroke_mm(found: Findings, motion: str) -> float | None:
    """Return the largest displacement in the runs of a motion [mm]; None if there are no such runs."""
    runs = [run for run in (*found.fitted.training, *found.fitted.held_out) if motion in run.run.name]
    return 1e3 * max(float(np.abs(run.trajectory.displacement).max()) for run in runs) if runs else None


def viscosity_fall_percent(found: Findings, cold: float, hot: float) -> float:
    """Return the decrease of the viscosity from ``cold`` to ``hot`` (in degC) [% of the value at 20 degC]."""
    factor = found.fluid.viscosity_factor
    return 100.0 * float(
        (factor.value(cold + ZERO_CELSIUS_K) - factor.value(hot + ZERO_CELSIUS_K))
        / factor.value(20.0 + ZERO_CELSIUS_K)
    )


def falls_per_K(found: Findings) -> tuple[float, float]:
    """Return the mean decrease of the viscosity from 20 to 60 degC and from 60 to 138 degC [% per K]."""
    return viscosity_fall_percent(found, 20.0, 60.0) / 40.0, viscosity_fall_percent(found, 60.0, 138.0) / 78.0


def viscosity_drop(found: Findings) -> float:
    """Return the decrease of the viscosity from 20 to 100 degC [%]."""
    return fall_percent(found.fluid.viscosity_factor)


def yield_drop(found: Findings) -> float:
    """Return the decrease of the yield stress from 20 to 100 degC [%]."""
    return fall_percent(found.fluid.yield_factor)


def collapse_begins(found: Findings) -> float | None:
    """Return the temperature at which the thermal collapse reduces the viscosity by 10 % [degC].

    Return None if the fluid has no collapse.
    """
    if found.fluid.collapse is None:
        return None
    warm = np.arange(100.0, 160.0, 0.05)
    left = found.fluid.collapse.value(warm + ZERO_CELSIUS_K)
    return float(warm[int(np.argmax(left < 0.9))])


# ------------------------------------------------------------------------- values of forces and heating


def peak_losses(found: Findings) -> dict[float, float]:
    """Return the decrease of the peak force from 20 to 120 degC [%] for each current [A]."""
    losses = {current: _peak_loss_percent(found.judged, current) for current in (0.0, 1.0, 2.0)}
    return {current: loss for current, loss in losses.items() if loss is not None}


def _peak_loss_percent(judged: Assessment, current: float) -> float | None:
    """Return the decrease of the measured peak force from 20 to 120 degC [%]; None if runs are missing."""
    runs = [e for e in judged.runs if e.command == current and "sine 5 mm 1 Hz" in e.motion]
    warm = {round(e.temperature_degC): e.peak_measured_N for e in runs if e.temperature_degC is not None}
    cold, hot = _nearest(warm, 20.0), _nearest(warm, 120.0)
    return None if cold is None or hot is None else 100.0 * (1.0 - hot / cold)


def _nearest(values: dict[int, float], degrees: float) -> float | None:
    """Return the value at the temperature nearest to ``degrees``; None if the distance is above 6 K."""
    near = min(values, key=lambda at: abs(at - degrees), default=None)
    return None if near is None or abs(near - degrees) > 6.0 else values[near]


def bare(found: Findings) -> Rise:
    """Return the simulated heating without fins, at an amplitude of 15 mm."""
    rise = found.warm_up.bare
    assert rise is not None  # The result is None only for a damper that has no fins.
    return rise


def temperature_at(rise: Rise, what: Literal["fluid", "wall"], time_s: float) -> float:
    """Return the temperature of fluid or wall at a time of a heating simulation [degC]."""
    if what == "fluid":
        return rise.fluid_at(time_s) - ZERO_CELSIUS_K
    return float(np.interp(time_s, rise.time, rise.wall_degC))


def small_bare_degC(found: Findings) -> float:
    """Return the fluid temperature [degC] without fins after 30 min at 5 mm amplitude."""
    small = found.small.bare
    assert small is not None  # The result is None only for a damper that has no fins.
    return temperature_at(small, "fluid", HALF_HOUR_S)


def slim_damper_degC(found: Findings) -> float:
    """Return the steady temperature of a finless damper of 23 mm diameter [degC].

    The heating power is the sum of the power that the simulated damper dissipates at 120 degC and the initial
    electric power of its coil.
    """
    body = found.warm_up.drawing.body
    surface = np.pi * 0.023 * (body.length + 0.5 * 0.023)
    # A cycle takes 1 s. Therefore the energy per cycle [J] is equal to the power [W].
    power = work_J(found)[-1] + float(bare(found).coil_W[0])
    return 20.0 + float(power / (_STILL_AIR_W_m2K * surface))


def half_hour(found: Findings) -> tuple[float, float]:
    """Return the fluid temperatures after 30 min with fins and without fins [degC]."""
    return temperature_at(found.warm_up.rise, "fluid", HALF_HOUR_S), temperature_at(
        bare(found), "fluid", HALF_HOUR_S
    )


def rise_reduction_percent(found: Findings) -> float:
    """Return the reduction of the temperature rise above 20 degC by the fins [%]."""
    finned, without = half_hour(found)
    return 100.0 * (without - finned) / (without - 20.0)


def work_J(found: Findings) -> list[float]:
    """Return the dissipated energy per cycle at 20, 40, 80 and 120 degC [J]."""
    work = found.works[0][1]
    return [float(work.power_at(degrees + ZERO_CELSIUS_K)) for degrees in (20.0, 40.0, 80.0, 120.0)]


def loss_percent(rise: Rise, time_s: float) -> float:
    """Return the loss of peak force at a time of a heating simulation, compared with 20 degC [%]."""
    end = rise.force_loss_percent
    assert end is not None
    cold = rise.peak_force_N[-1] / (1.0 - end / 100.0)
    return float(100.0 * (1.0 - np.interp(time_s, rise.time, rise.peak_force_N) / cold))


# --------------------------------------------------------------- values of the model and force tracking


def rmse_at(judged: Assessment, degrees: float) -> float | None:
    """Return the RMS error of the runs at a temperature [N]; None if there are no such runs."""
    found = _runs_at(judged, degrees)
    return float(np.sqrt(np.mean([e.rmse_N**2 for e in found]))) if found else None


def describe_split(judged: Assessment, degrees: float) -> str:
    """Return a text with the number of held-out runs at a temperature."""
    runs = _runs_at(judged, degrees)
    held = sum(e.split == "held_out" for e in runs)
    return f"{held} of {len(runs)} runs held out of the fit"


def _runs_at(judged: Assessment, degrees: float) -> list[RunError]:
    return [
        e
        for e in judged.runs
        if e.command is not None
        and e.temperature_degC is not None
        and abs(e.temperature_degC - degrees) < 2.0
    ]


def find_worst_score(found: Findings, controller: str, target: str = "sine-900N-1Hz") -> Score:
    """Return the score of a controller for a target, with the maximum errors over all temperatures."""
    return next(
        r.score for r in found.track.max_error_rows if (r.controller, r.target) == (controller, target)
    )


def unaware_ratio(found: Findings, aware: str, unaware: str) -> float | None:
    """Return the max error of the controller ``unaware``, divided by the max error of ``aware`` [-].

    Return None if an error is missing.
    """
    known, blind = (find_worst_score(found, name).max_feasible_N for name in (aware, unaware))
    return blind / known if known and blind is not None else None


def works_up_to_degC(found: Findings, controller: str) -> float | None:
    """Return the highest temperature [degC] with an acceptable control error.

    The RMS error must not exceed the maximum error that the reference paper reports. Return None if the error
    is larger at the lowest tested temperature.
    """
    rows = [r for r in found.track.rows if (r.controller, r.target) == (controller, "sine-900N-1Hz")]
    works = None
    for row in sorted(rows, key=lambda row: row.temperature_degC):
        if not (row.score.rmse_feasible_N or np.inf) <= _PAPER_ERROR_RATIO * 900.0:
            break
        works = row.temperature_degC
    return works
