"""Campaign consistency: does each run belong to the damper that the others were fitted to, and if not, why.

A fit reproduces a campaign in which one run has a wrong gain, delay, command or offset nearly as well as a
sound one. What is left of such a run, though, has the shape of that cause: each run's residual is compared
with the change of the model's force per unit of every cause (its sensitivity), and the estimate with those of
all other runs, whose scatter is what the law cannot follow. The simplest cause that explains it is told.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from mrdamper.arrays import FloatArray, rms
from mrdamper.data.finding import Finding, percent
from mrdamper.data.prepare import PreparedRun, decimate
from mrdamper.errors import InputError
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import simulate

__all__ = ["CAUSES", "Effect", "consistency", "doubted", "effects_of"]

_RATE_Hz = 200.0  # of the samples that are compared
_STEP_s, _STEP_COMMAND = 1e-3, 0.02  # of the differences that stand for derivatives
_FEWEST = 6  # runs, below which their scatter says nothing
_AS_WELL = 0.05  # of the share that a cause explains
_DOUBT, _DOUBTED = 0.8, 1.8  # of a cause's score: to leave a run out, and to tell it then
_FAR = 1.6  # times the usual residual
_HALF = 0.5  # of the worst run's score
_WORSE = 3.0  # times the campaign's residual: a command that fits no worse than this is one of those that do
_PEERS = 3  # runs of one command, below which all runs stand for them


@dataclass(frozen=True, slots=True)
class Cause:
    """One thing that can be wrong with a run, how it is told, and when.

    ``least`` is the smallest size that is told, and ``clear`` by how many times the scatter of the other runs
    a run must leave them. ``score`` is the least product of the part of the residual that the cause explains,
    over the usual residual of runs at this command, and its share of the run's own: large and of the right
    shape.
    """

    kind: str
    unit: str
    least: float
    clear: float
    score: float
    words: str
    effect: str
    remedy: str


_LEVEL = "Peak force and viscosity of the card are pulled towards this run's"
CAUSES: Mapping[str, Cause] = MappingProxyType(
    {
        each.kind: each
        for each in (
            Cause(
                "force_delay", "s", 1.2e-3, 3.0, 0.25,
                "its force comes {0:.3g} ms later than the other runs'",
                "A delay is taken for hysteresis: the yield displacement comes out wrong",
                "Compare filters and converters of this file with the others'",
            ),
            Cause(
                "force_gain", "-", 0.04, 1.3, 0.9,
                "its force is {0:.3f} times that of the other runs", _LEVEL,
                "Check range and amplifier of the load cell in this file",
            ),
            Cause(
                "command_label", "A", 0.03, 1.3, 0.9,
                "its force is that of a command {0:+.3f} {1} away from its label",
                "The force over command of the card is bent at this run's command",
                "Check the current of this file against the source's record",
            ),
            Cause(
                "force_offset_of_run", "N", 3.0, 2.0, 0.3,
                "its force is shifted by {0:+.4g} N against the other runs",
                "A law without an offset leaves it in its error",
                "Zero the load cell, or let sessions have offsets of their own (⟦--session-offsets⟧)",
            ),
        )
    }
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Effect:
    """How large one cause would have to be in one run, and how much of the run's residual it explains."""

    size: float
    error: float  # standard error, from the residual that it leaves
    explained: float  # rms of the part of the residual that it explains, over the force's spread
    share: float  # of the residual's mean square


def consistency(damper: Damper, runs: Sequence[PreparedRun], *, without: str = "") -> tuple[Finding, ...]:
    """Return what does not belong together in a campaign, by runs and groups of runs.

    Parameters
    ----------
    damper : fitted to the runs
    without : the run that was left out of that fit because it was doubted: it has to leave the others further
    """
    steady, found, usual = _compared(damper, runs)
    if not steady:
        return ()
    told = _suspects(found, usual, [_DOUBTED if run.name == without else 1.0 for run in steady])
    exchanged = dict(_exchanged(steady, found, told))
    sessions = tuple(_sessions(steady, found))
    grouped = {finding.run for finding in sessions}
    return (
        *sessions,
        *(
            exchanged.get(number) or _finding(steady[number], kind, size, error, _either(kind, found[number]))
            for number, (kind, size, error) in told.items()
            if steady[number].run.session not in grouped
        ),
    )


def doubted(damper: Damper, runs: Sequence[PreparedRun]) -> str:
    """Return the name of the run that is most likely wrong, to be left out of another fit; empty: none is."""
    steady, found, usual = _compared(damper, runs)
    told = _suspects(found, usual, [_DOUBT] * len(steady))
    if told:
        return steady[next(iter(told))].name
    ratios = [_residual(each) / (scale or 1.0) for each, scale in zip(found, usual, strict=True)]
    worst = int(np.argmax(ratios)) if ratios else 0
    return steady[worst].name if ratios and ratios[worst] > _FAR else ""


def _compared(
    damper: Damper, runs: Sequence[PreparedRun]
) -> tuple[list[PreparedRun], list[dict[str, Effect]], list[float]]:
    """Return the runs of one command each, the effects in them, and their usual residuals; too few: none."""
    steady = [run for run in runs if run.run.constant_command is not None]
    if len(steady) < _FEWEST:
        return [], [], []
    found = [effects_of(damper, run) for run in steady]
    return steady, found, _usual_residuals(steady, found)


def _residual(effects: Mapping[str, Effect]) -> float:
    """Return a run's residual over the force's spread."""
    gain = effects["force_gain"]
    return gain.explained / float(np.sqrt(gain.share)) if gain.share > 0.0 else 0.0


def effects_of(damper: Damper, run: PreparedRun) -> dict[str, Effect]:
    """Return the size of every cause in one run, each by itself, by least squares on the model's residual."""
    coarse = decimate(run, _RATE_Hz)
    path, span = coarse.trajectory, slice(coarse.scored_from, None)
    limited = damper.on_limits()
    model = simulate(limited, path)
    step = _STEP_COMMAND * (1.0 if float(path.command[0]) + _STEP_COMMAND > 0.0 else -1.0)
    try:
        shifted = simulate(limited, replace(path, command=path.command + step))
    except InputError:  # beyond what the law is posed at
        shifted = model
    sensitivity = {
        "force_gain": model,
        "force_delay": -np.gradient(model, path.step),
        "command_label": (shifted - model) / step,
        "force_offset_of_run": np.ones_like(model),
    }
    residual = coarse.force[span] - model[span]
    spread = float(np.std(coarse.force[span]))
    offset = float(np.mean(residual))
    return {
        kind: _effect(residual if kind == "force_offset_of_run" else residual - offset, values[span], spread)
        for kind, values in sensitivity.items()
    }


def _effect(residual: FloatArray, sensitivity: FloatArray, spread: float) -> Effect:
    power, left = float(sensitivity @ sensitivity), float(residual @ residual)
    if power == 0.0 or left == 0.0:
        return Effect(0.0, 0.0, 0.0, 0.0)
    size = float(sensitivity @ residual) / power
    share = size**2 * power / left
    # half a cycle of residual hangs together: some ten samples are one
    error = float(np.sqrt(max(1.0 - share, 0.0) * left / power / max(len(residual) / 10.0, 1.0)))
    return Effect(size, error, abs(size) * float(np.sqrt(power / len(residual))) / spread, share)


def _usual_residuals(runs: Sequence[PreparedRun], found: Sequence[Mapping[str, Effect]]) -> list[float]:
    """Return the usual residual over the force's spread, for each run from the runs of its command.

    Without current a law often fits worse; a run that is wrong bends all runs of its command, though.
    """
    residuals = np.array([_residual(each) for each in found])
    commands = np.array([run.run.constant_command for run in runs], dtype=np.float64)
    near = 0.05 * (float(np.ptp(commands)) or 1.0)
    usual = []
    for command in commands:
        peers = np.abs(commands - command) <= near
        level = float(np.median(residuals[peers] if peers.sum() >= _PEERS else residuals))
        usual.append(min(level, _WORSE * float(np.median(residuals))))
    return usual


def _suspects(
    found: Sequence[Mapping[str, Effect]], usual: Sequence[float], least: Sequence[float]
) -> dict[int, tuple[str, float, float]]:
    """Return the runs that leave the others, worst first, each with its simplest cause, size and error.

    ``least`` is the score of each run that is told, as a multiple of the cause's.

    Causes are compared by strength: the part of the residual that they explain, with the sign of their size,
    over the usual residual. A run that is far off bends the fit for the others: those of less than half the
    worst score are not told.
    """
    told: dict[int, tuple[float, str, float, float, float]] = {}
    for kind, cause in CAUSES.items():
        effects = [each[kind] for each in found]
        strengths = np.array(
            [np.sign(e.size) * e.explained / (u or 1.0) for e, u in zip(effects, usual, strict=True)]
        )
        for number, (mine, strength) in enumerate(zip(effects, strengths.tolist(), strict=True)):
            others = np.delete(strengths, number)
            scatter = 1.4826 * float(np.median(np.abs(others - np.median(others))))
            score = abs(strength) * mine.share
            if (
                abs(mine.size) < cause.least
                or score < least[number] * cause.score
                or abs(strength) < cause.clear * scatter
            ):
                continue
            error = max(abs(mine.size / strength) * scatter, mine.error)
            relative = score / cause.score
            if number not in told or mine.share > told[number][4] + 0.02:
                told[number] = (relative, kind, mine.size, error, mine.share)
    worst = max((each[0] for each in told.values()), default=0.0)
    ordered = sorted(told.items(), key=lambda each: -each[1][0])
    return {number: each[1:4] for number, each in ordered if each[0] > _HALF * worst}


def _finding(run: PreparedRun, kind: str, size: float, error: float, also: Effect | None = None) -> Finding:
    """Return the finding; ``also`` is what explains the run as well: one run alone cannot tell them apart."""
    cause, unit = CAUSES[kind], run.run.command_unit
    shown = {"force_delay": 1e3 * size, "force_gain": 1.0 + size}.get(kind, size)
    value = 1.0 + size if kind == "force_gain" else size
    return Finding(
        kind=kind,
        severity="warning",
        channel="current" if kind == "command_label" else "force",
        run=run.name,
        size=value,
        low=value - 2.0 * error,
        high=value + 2.0 * error,
        unit=unit if kind == "command_label" else cause.unit.replace("-", ""),
        found=cause.words.format(shown, unit) + _other_words(kind, also, unit),
        effect=cause.effect,
        remedy=f"{cause.remedy}; until then leave the run out",
    )


def _other_words(kind: str, also: Effect | None, unit: str) -> str:
    if also is None:
        return ""
    if kind == "force_gain":
        return f", or its command label is off by {-also.size:+.3f} {unit} (one run cannot tell)"
    return f", or its force gain is {1.0 + also.size:.3f} (one run cannot tell)"


def _either(kind: str, effects: Mapping[str, Effect]) -> Effect | None:
    """Return what explains a run as well as the cause that is told: gain and command look alike."""
    other = {"force_gain": "command_label", "command_label": "force_gain"}.get(kind)
    if other is None or effects[other].share < effects[kind].share - _AS_WELL:
        return None
    return effects[other]


def _exchanged(
    runs: Sequence[PreparedRun],
    found: Sequence[Mapping[str, Effect]],
    told: Mapping[int, tuple[str, float, float]],
) -> Iterator[tuple[int, Finding]]:
    """Give pairs of runs that are told, each of which has the force of the other one's command."""
    for a in told:
        for b in told:
            one, other = (runs[k].run.constant_command for k in (a, b))
            if a == b or one is None or other is None or runs[a].motion != runs[b].motion or one == other:
                continue
            apart = other - one
            shifts = (found[a]["command_label"].size / apart, -found[b]["command_label"].size / apart)
            if min(shifts) > 0.3 and max(shifts) < 3.0:
                said = _finding(runs[a], "command_label", apart, abs(apart) * abs(shifts[0] - shifts[1]))
                yield (
                    a,
                    replace(
                        said,
                        kind="labels_exchanged",
                        found=f"it has the force of {runs[b].name}'s command, and that run its own: "
                        "the two seem to be exchanged",
                        remedy="Exchange the two files' commands, or leave both out until it is known",
                    ),
                )


def _sessions(runs: Sequence[PreparedRun], found: Sequence[Mapping[str, Effect]]) -> Iterator[Finding]:
    """Give sessions of several runs whose forces are all larger or smaller than the other sessions'."""
    groups: dict[str, list[float]] = {}
    for run, each in zip(runs, found, strict=True):
        groups.setdefault(run.run.session, []).append(each["force_gain"].size)
    large = {name: np.array(sizes) for name, sizes in groups.items() if len(sizes) >= _PEERS}
    for name, sizes in large.items():
        others = np.concatenate([each for other, each in large.items() if other != name] or [np.empty(0)])
        if len(others) < _PEERS:
            continue
        gain = float(np.median(sizes) - np.median(others))
        scatter = rms(np.concatenate([sizes - np.median(sizes), others - np.median(others)]))
        error = scatter * float(np.sqrt(1.0 / len(sizes) + 1.0 / len(others)))
        if abs(gain) < CAUSES["force_gain"].least or abs(gain) < 4.0 * error:
            continue
        yield Finding(
            kind="session_gain",
            severity="warning",
            channel="force",
            run=name,
            size=1.0 + gain,
            low=1.0 + gain - 2.0 * error,
            high=1.0 + gain + 2.0 * error,
            found=f"the {len(sizes)} runs of this session have {percent(abs(gain))} "
            f"{'more' if gain > 0.0 else 'less'} force than the others'",
            effect="One card is fitted to two dampers, two temperatures or two calibrations",
            remedy="Identify the sessions apart and compare the cards; record the temperature",
        )
