"""Which run of a campaign does not belong to the damper that the others were fitted to, and why.

A fit reproduces a campaign in which one run has a wrong gain, delay, command or offset nearly as well as a
sound one. What is left of such a run, though, has the shape of that cause (``effects``). A law is off by a
little at each command and each motion: sizes are compared with those that the runs of the same command and of
the same motion have, and with the scatter of all. The simplest cause that explains a run is told.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mrdamper.arrays import FloatArray, rms
from mrdamper.data.finding import Finding
from mrdamper.data.prepare import PreparedRun
from mrdamper.identify.consistency.causes import CAUSES, least_told
from mrdamper.identify.consistency.effects import Effect, Residuals, residuals_of
from mrdamper.identify.consistency.groups import find_together
from mrdamper.models.damper import Damper

_FEWEST = 6  # runs, below which their scatter says nothing
_AS_WELL = 0.05  # of the share that a cause explains
_DOUBT, _DOUBTED = 0.8, 1.8  # of what a cause needs: to leave a run out, and to tell it then
_FAR = 1.6  # times the usual residual
_HALF = 0.5  # of the worst run's departure
_WORSE = 3.0  # times the campaign's residual: a command that fits no worse than this is one of those that do
_PEERS = 3  # runs of one command, below which all runs stand for them
_SIMPLER = 0.9  # of a departure: the simpler cause is told as long as it explains as much
_SPARE = 5  # runs more than there are levels of command and motion, to compare them with
_MANY = 12  # runs of one command, from which on they have a scatter of their own
_STEPS = 30  # of the least sum of absolute departures


@dataclass(frozen=True, slots=True)
class _Departure:
    """How far one run leaves the others by one cause."""

    kind: str
    size: float
    error: float
    times: float  # in what the cause needs to be told: 1 is told
    strength: float  # in usual residuals, weighed by how plain the cause is


def consistency(
    damper: Damper,
    runs: Sequence[PreparedRun],
    *,
    free: Sequence[str] = (),
    without: str = "",
    sure: bool = False,
) -> tuple[Finding, ...]:
    """Return what does not belong together in a campaign, by runs and groups of runs.

    Parameters
    ----------
    damper : fitted to the runs
    free : its parameters that were fitted
    without : the run that was left out of that fit because it was doubted
    sure : it was told of before, too; otherwise it has to leave the others further
    """
    found = _compared(damper, runs, free, without)
    if found is None:
        return ()
    steady = found.runs
    common, groups = find_together(found)
    if groups:
        return (*common, *groups)
    least = 1.0 if sure else _DOUBTED
    told = _suspects(found, [least if run.name == without else 1.0 for run in steady], without)
    exchanged = dict(_exchanged(found, told))
    return common + tuple(
        exchanged.get(number) or _finding(steady[number], each, _either(each.kind, found, number))
        for number, each in told.items()
    )


def doubted(damper: Damper, runs: Sequence[PreparedRun], *, free: Sequence[str] = ()) -> tuple[str, ...]:
    """Return the names of the runs that are most likely wrong, each to be left out of another fit.

    The one that leaves the others most, and the one that is fitted worst: at the end of a series of motions
    they may be two, as the fit follows a wrong run there and leaves the sound ones.
    """
    found = _compared(damper, runs, free)
    if found is None:
        return ()
    told = list(_suspects(found, [_DOUBT] * len(found.runs)))[:1]
    ratios = found.levels / _usual_levels(found)
    worst = int(np.argmax(ratios))
    if ratios[worst] > _FAR and worst not in told:
        told.append(worst)
    return tuple(found.runs[number].name for number in told)


def misfit(damper: Damper, runs: Sequence[PreparedRun], *, without: str) -> float:
    """Return what a damper leaves of all runs but one: the rms of their residuals over their spreads."""
    steady = [run for run in runs if run.run.constant_command is not None and run.name != without]
    return rms(residuals_of(damper, steady).levels)


def _compared(
    damper: Damper, runs: Sequence[PreparedRun], free: Sequence[str], without: str = ""
) -> Residuals | None:
    """Return the residuals of the runs of one command each; None where these are too few."""
    steady = [run for run in runs if run.run.constant_command is not None]
    return residuals_of(damper, steady, free, without=without) if len(steady) >= _FEWEST else None


def _usual_levels(found: Residuals) -> FloatArray:
    """Return the usual residual over the force's spread, for each run from the runs of its command.

    Without current a law often fits worse; a run that is wrong bends all runs of its command, though.
    """
    levels, usual = found.levels, []
    place = _command_levels(found.runs)
    for number in range(len(found.runs)):
        peers = place == place[number]
        level = float(np.median(levels[peers] if peers.sum() >= _PEERS else levels))
        usual.append(min(level, _WORSE * float(np.median(levels))) or 1.0)
    return np.array(usual)


def _suspects(found: Residuals, least: Sequence[float], without: str = "") -> dict[int, _Departure]:
    """Return the runs that leave the others, worst first, each with its simplest cause.

    ``least`` is how far each run has to leave them, in what the cause needs; the run ``without`` has no part
    in what is usual. A run that is far off bends the
    fit for the others: those of less than half the worst departure are not told.
    """
    usual, peers, place = _usual_levels(found), _peers(found.runs), _command_levels(found.runs)
    counts = np.array([run.name != without for run in found.runs])
    told: dict[int, _Departure] = {}
    for kind, cause in CAUSES.items():
        effects = [found.of_run(number, kind) for number in range(len(found.runs))]
        sizes = np.array([each.size for each in effects])
        per_size = np.array([each.explained / (abs(each.size) or 1.0) for each in effects]) / usual
        departures, scatter = _departures(sizes, per_size, peers, counts)
        for number, departure in enumerate(departures.tolist()):
            own = counts & (place == place[number])
            apart = scatter
            if own.sum() >= _MANY:  # a law is off by more at some commands than at others
                apart = max(scatter, 1.4826 * float(np.median(np.abs(departures[own]))))
            needed = max(cause.clear * apart, cause.strength)
            size, weight = departure / (per_size[number] or 1.0), float(per_size[number]) or 1.0
            times = min(abs(departure) / needed, abs(size) / least_told(cause, found.runs, number))
            if times < least[number]:
                continue
            each = _Departure(
                kind, size, max(apart / weight, effects[number].error), times, cause.plain * abs(departure)
            )
            if number not in told or told[number].strength < _SIMPLER * each.strength:
                told[number] = each
    worst = max((each.times for each in told.values()), default=0.0)
    ordered = sorted(told.items(), key=lambda item: -item[1].times)
    return {number: each for number, each in ordered if each.times > _HALF * worst}


def _departures(
    sizes: FloatArray, per_size: FloatArray, peers: FloatArray, counts: np.ndarray
) -> tuple[FloatArray, float]:
    """Return by how much each run leaves its peers, in usual residuals, and the scatter of those that count.

    The peers' sizes are those for which the sum of absolute departures is least: one run of many moves them
    by nothing. Compared are the peers by command and motion, or all runs, whichever leaves less scatter.
    """
    best: tuple[FloatArray, float] | None = None
    for design in (peers, np.ones((len(sizes), 1))):
        weight, left = per_size.copy(), sizes
        for _ in range(_STEPS):
            root = np.sqrt(weight * counts)
            fitted = np.linalg.lstsq(design * root[:, None], sizes * root, rcond=None)[0]
            left = sizes - design @ fitted
            away = np.abs(left * per_size)
            weight = per_size**2 / np.maximum(away, 1e-3 * float(np.median(away)) + 1e-300)
        departures = left * per_size
        # as many departures as there are levels are next to nothing: they say nothing of the scatter
        rank = int(np.linalg.matrix_rank(design))
        scatter = 1.4826 * float(np.median(np.sort(np.abs(departures[counts]))[rank:]))
        if best is None or scatter < best[1]:
            best = departures, scatter
    assert best is not None
    return best


def _peers(runs: Sequence[PreparedRun]) -> FloatArray:
    """Return the columns of which the usual size of a run is made: its command's, and its motion's.

    A campaign at several temperatures has runs of the same command and motion, which are the peers. Where
    hardly two runs share a motion, a slope with the speed at each command stands for it. Too few runs for
    that: the command alone, or nothing.
    """
    count, place = len(runs), _command_levels(runs)
    commands = np.array([place == level for level in range(int(place.max()) + 1)], dtype=np.float64).T
    motions = sorted({run.motion for run in runs})
    design = commands
    cells = sorted({(level, run.motion) for level, run in zip(place.tolist(), runs, strict=True)})
    if len(cells) <= count / _PEERS:  # at several temperatures
        columns = [
            [(level, run.motion) == cell for level, run in zip(place, runs, strict=True)] for cell in cells
        ]
        design = np.array(columns, dtype=np.float64).T
    elif len(motions) <= count / _PEERS:
        columns = [[run.motion == motion for run in runs] for motion in motions[1:]]
        design = np.column_stack([commands, *np.array(columns, dtype=np.float64)])
    elif commands.sum(axis=0).min() > _PEERS:
        speed = np.log([float(np.std(run.trajectory.velocity)) for run in runs])
        middle = (commands.T @ speed) / commands.sum(axis=0)
        design = np.column_stack([commands, commands * (speed[:, None] - middle)])
    for each in (design, commands):
        if count - int(np.linalg.matrix_rank(each)) >= _SPARE:
            return each
    return np.ones((count, 1))


def _command_levels(runs: Sequence[PreparedRun]) -> np.ndarray:
    """Return the number of each run's command among the levels that the runs have."""
    commands = np.array([run.run.constant_command for run in runs], dtype=np.float64)
    order = np.argsort(commands, kind="stable")
    near = 0.05 * (float(np.ptp(commands)) or 1.0)
    place = np.empty(len(runs), dtype=int)
    place[order] = np.concatenate([[0], np.cumsum(np.diff(commands[order]) > near)])
    return place


def _finding(run: PreparedRun, told: _Departure, also: Effect | None = None) -> Finding:
    """Return the finding; ``also`` is what explains the run as well: one run alone cannot tell them apart."""
    kind, size = told.kind, told.size
    cause, unit = CAUSES[kind], run.run.command_unit
    shown = {"force_delay": 1e3 * size, "force_gain": 1.0 + size}.get(kind, size)
    value = 1.0 + size if kind == "force_gain" else size
    return Finding(
        kind=kind,
        severity="warning",
        channel="current" if kind == "command_label" else "force",
        run=run.name,
        size=value,
        unit=unit if kind == "command_label" else cause.unit.replace("-", ""),
        found=cause.words.format(shown, unit) + _other_words(kind, also, unit),
        effect=cause.effect,
        remedy=f"{cause.remedy}; until then leave the run out",
    ).within(told.error)


def _other_words(kind: str, also: Effect | None, unit: str) -> str:
    if also is None:
        return ""
    if kind == "force_gain":
        return f", or its command label is off by {-also.size:+.3f} {unit} (one run cannot tell)"
    return f", or its force gain is {1.0 + also.size:.3f} (one run cannot tell)"


def _either(kind: str, found: Residuals, number: int) -> Effect | None:
    """Return what explains a run as well as the cause that is told: gain and command look alike."""
    other = {"force_gain": "command_label", "command_label": "force_gain"}.get(kind)
    if other is None:
        return None
    effect = found.of_run(number, other)
    return None if effect.share < found.of_run(number, kind).share - _AS_WELL else effect


def _exchanged(found: Residuals, told: Mapping[int, _Departure]) -> Iterator[tuple[int, Finding]]:
    """Give pairs of runs that are told, each of which has the force of the other one's command."""
    runs = found.runs
    for a in told:
        for b in told:
            one, other = (runs[k].run.constant_command for k in (a, b))
            if a == b or one is None or other is None or runs[a].motion != runs[b].motion or one == other:
                continue
            apart = other - one
            shifts = [
                sign * found.of_run(k, "command_label").size / apart for k, sign in ((a, 1.0), (b, -1.0))
            ]
            if min(shifts) > 0.3 and max(shifts) < 3.0:
                error = abs(apart) * abs(shifts[0] - shifts[1])
                said = _finding(runs[a], _Departure("command_label", apart, error, 1.0, 1.0))
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
