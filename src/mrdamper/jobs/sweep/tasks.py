"""Run the tasks of a sweep on processes of this machine, or on the workers of a Dask cluster.

Any process can import the function of a task, and its result is a JSON value. A result contains no run time
and no path of the worker, so that equal tasks give equal results on every machine. An input error is returned
as a result. Any other error is raised.

Results are generated in order of completion. If a worker dies, its task is repeated on another worker. If
workers die repeatedly and no task is completed in between, an error is raised.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from typing import Any

import numpy as np

from mrdamper.control.controllers import controllers_for
from mrdamper.control.loop import reference_trajectory, run_loop
from mrdamper.control.scenario import SCENARIOS, find_scenario
from mrdamper.control.score import attainable_range, combine_worst, score_run
from mrdamper.errors import InputError, MissingExtraError, MrdamperError
from mrdamper.identify.scores import summary
from mrdamper.jobs.fit import fit, options_for
from mrdamper.jobs.inputs import read_dataset
from mrdamper.jobs.options import FitOptions, HeatsinkOptions
from mrdamper.jobs.sweep.plan import SweepKind, Task
from mrdamper.jobs.thermal.heatsink import heatsink
from mrdamper.jobs.track import TEMPERATURES_DEGC
from mrdamper.models.card_schema import card_from_json, card_to_json
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.runtime.pool import process_pool
from mrdamper.schema import Json
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.duty import Duty
from mrdamper.virtual_rig.damper import find_preset
from mrdamper.virtual_rig.plant import Plant

DEATHS_MAX = 20
"""Number of worker deaths without a result in between that ends a sweep.

If memory is short, tasks succeed after some deaths. A task that kills every worker would be repeated forever.
"""
CONNECT_MAX_S = 20
WORKERS_WAIT_MAX_S = 600.0  # The scheduler of a cluster may wait for minutes until the first worker starts.


Result = dict[str, Any]
"""Result of a task, as a JSON object."""


def run_task(task: Task) -> Result:
    """Run one task; return {"figures": values by name} (and "card" for a fit), or {"error": reason}."""
    try:
        return _KINDS[task.kind](task.seed, **task.arguments)
    except MrdamperError as fault:
        return {"error": str(fault)}


def _fit(_seed: int, *, path: str, law: str | None) -> Result:
    """Fit a campaign; return error values, fitted parameters and the model card."""
    dataset = read_dataset([path])
    chosen = replace(options_for(dataset, FitOptions()), jobs=1)  # One core for each task.
    fitted = fit(dataset, law, options=chosen)
    judged = fitted.assessment
    figures: dict[str, float | None] = {}
    for split in ("training", "held_out"):
        errors = [error for error in judged.runs if error.split == split]
        if errors:
            figures |= {f"{split}_{name}": value for name, value in summary(errors).items()}
    figures |= {f"{each.name}": each.value for each in fitted.estimates}
    return {"figures": _json_values(figures), "card": card_to_json(fitted.card(judged))}


def _track(seed: int, *, card: Json, spread_percent: float) -> Result:
    """Test the controller ``recommended`` on a random variant of the virtual damper."""
    sampling_s = 1e-3  # sampling period of the controllers; the default of the job ``track``
    known = card_from_json(card)
    damper = find_preset("nominal").draw(np.random.default_rng(seed), spread_percent / 100.0)
    largest = min(damper.highest_A, known.envelope.command[1])
    controller = controllers_for(known, period_s=sampling_s, largest=largest)["recommended"]
    rig = Plant(damper)
    figures: dict[str, float | None] = {}
    for target in SCENARIOS:
        scores = []
        for degrees in TEMPERATURES_DEGC:
            scenario = replace(
                find_scenario(target), temperature_degC=degrees, highest_A=largest, seed=seed % 2**31
            )
            course = reference_trajectory(scenario, rig.step_s)
            reach = attainable_range(rig, course, degrees, largest)
            run = run_loop(rig, controller, scenario, course)
            scores.append(score_run(run, reach, resistance_ohm=damper.coil_resistance_ohm(degrees)))
        score = combine_worst(scores)
        figures |= {
            f"{target}_max_N": score.max_N,
            f"{target}_max_feasible_N": score.max_feasible_N,
            f"{target}_rmse_feasible_N": score.rmse_feasible_N,
            f"{target}_feasible_share": score.feasible_share,
        }
    return {"figures": _json_values(figures)}


def _search_sink(_seed: int, *, card: Json, drawing: DamperDrawing, duty: Duty) -> Result:
    """Search for the coolest heat sink; return dimensions and fluid temperatures.

    The temperatures are computed without a heat sink, with the original one, and with the coolest one.
    """
    run = heatsink(card_from_json(card), drawing, duty, HeatsinkOptions())
    best = run.best.sink
    assert best is not None  # The search evaluates only designs with a heat sink.
    return {
        "figures": _json_values(
            {
                "bare_degC": run.bare.fluid - ZERO_CELSIUS_K,
                "reference_degC": run.reference.fluid - ZERO_CELSIUS_K,
                "best_degC": run.best.fluid - ZERO_CELSIUS_K,
                "best_mass_kg": run.best.mass,
                "best_fins": float(best.fins),
                "best_width_m": best.width,
                "best_thickness_m": best.thickness,
            }
        )
    }


def _json_values(figures: Mapping[str, float | None]) -> dict[str, float | None]:
    """Return the values as floats, and None for values that are not finite."""
    return {
        name: None if value is None or not np.isfinite(value) else float(value)
        for name, value in figures.items()
    }


_KINDS: Mapping[SweepKind, Callable[..., Result]] = {
    "campaigns": _fit,
    "samples": _track,
    "dampers": _search_sink,
}


def run_on_processes(tasks: Sequence[Task], workers: int) -> Iterator[tuple[Task, Result]]:
    """Generate (task, result) pairs; the tasks run on processes of this machine.

    Raises
    ------
    InputError
        If ``DEATHS_MAX`` workers die and no task is completed in between.
    """
    left = {task.name: task for task in tasks}
    deaths = 0
    while left:
        with process_pool(min(workers, len(left))) as pool:
            futures = {pool.submit(run_task, task): task for task in left.values()}
            try:
                for future in as_completed(futures):
                    result = future.result()
                    task = futures.pop(future)
                    del left[task.name]
                    yield task, result
                    deaths = 0
            except BrokenProcessPool as fault:
                deaths += 1
                if deaths >= DEATHS_MAX:
                    raise InputError(
                        f"workers died {deaths} times without a result, {len(left)} tasks are left",
                        remedy="Use fewer --workers if memory is short; --resume goes on with the rest",
                    ) from fault


def run_on_cluster(tasks: Sequence[Task], address: str) -> Iterator[tuple[Task, Result]]:
    """Generate (task, result) pairs; the tasks run on a Dask cluster.

    The workers need this package, and access to the files of the tasks under the same paths.

    Raises
    ------
    InputError
        If no scheduler answers at the address, the scheduler stops or has no worker, or workers die
        repeatedly during one task.
    MissingExtraError
        If dask.distributed is not installed.
    """
    try:
        from distributed import Client, KilledWorker, as_completed
    except ImportError as fault:
        raise MissingExtraError.for_package("a sweep on a cluster", "dask.distributed", "scale") from fault
    # Dask would print messages in addition to the error of this function.
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
    place = f"scheduler {address!r}"
    try:
        client = Client(address, timeout=CONNECT_MAX_S, set_as_default=False)
    except (OSError, ValueError) as fault:
        raise InputError(
            f"no answer within {CONNECT_MAX_S} s ({fault})",
            place=place,
            expected="the address of a Dask scheduler, such as tcp://host:8786",
        ) from fault
    with client:
        try:
            client.wait_for_workers(1, timeout=WORKERS_WAIT_MAX_S)
        except TimeoutError as fault:
            raise InputError(
                f"has had no worker for {WORKERS_WAIT_MAX_S:g} s",
                place=place,
                remedy="Start workers there; --resume goes on with the rest",
            ) from fault
        futures = {
            future.key: (future, task)
            for task in tasks
            for future in [client.submit(run_task, task, pure=False, retries=DEATHS_MAX)]
        }
        deaths = 0
        ready = as_completed([future for future, _ in futures.values()], loop=client.loop)
        for future in ready:
            _, task = futures.pop(future.key)
            try:
                result = future.result()
            except KilledWorker as fault:
                deaths += 1
                if deaths >= DEATHS_MAX:
                    raise InputError(
                        f"workers died {deaths} times without a result",
                        place=f"task {task.name}",
                        remedy="--resume goes on with the rest",
                    ) from fault
                again = client.submit(run_task, task, pure=False, retries=DEATHS_MAX)
                futures[again.key] = again, task
                ready.add(again)
                continue
            except CancelledError as fault:
                raise InputError(
                    "the scheduler has ended",
                    place=place,
                    remedy="Start it again; --resume goes on with the rest",
                ) from fault
            deaths = 0
            yield task, result
