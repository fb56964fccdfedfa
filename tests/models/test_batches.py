"""A run in batches: the force of the whole run, bit for bit, whatever the borders and the motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper import core
from mrdamper.errors import InputError
from mrdamper.excitation import Trajectory
from mrdamper.models.actuation import Actuation
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant, ParameterLaw, Polynomial, TemperatureDependent
from mrdamper.models.laws import LAWS
from mrdamper.models.simulate import RunState, finish_run, open_drive, simulate, simulate_batch
from mrdamper.models.temperature import Linear
from tests.core.test_laws import FRICTION, TYPICAL, random_drive, with_command
from tests.support.examples import examples

ROUGH = 2e-6  # [m]


def moved(name: str, **more: object) -> Damper:
    """Return a damper of a law whose yield force follows the command, and its rho where it has one."""
    values: dict[str, ParameterLaw] = {
        key: Constant(value) for key, value in {**TYPICAL[name], **FRICTION}.items()
    }
    values["yield_force"] = Polynomial((0.4 * TYPICAL[name]["yield_force"], TYPICAL[name]["yield_force"]))
    if "rho" in values:
        values["rho"] = Polynomial((1000.0, 600.0))
    return Damper(LAWS[name], values, **more)  # type: ignore[arg-type]


def rough(path: Trajectory, seed: int, dead_band: float = 6.0 * ROUGH) -> Trajectory:
    """Return a motion with noise on the displacement, rests in it, and a dead band above the noise."""
    rng = np.random.default_rng(seed)
    x, v = path.displacement.copy(), path.velocity.copy()
    rest = slice(len(x) // 3, len(x) // 2)
    x[rest], v[rest] = x[rest.start], 0.0
    return replace(
        path,
        displacement=x + rng.uniform(-ROUGH, ROUGH, len(x)),
        velocity=v + rng.uniform(-1e-3, 1e-3, len(x)),
        dead_band=dead_band,
    )


def part(path: Trajectory, begin: int, end: int) -> Trajectory:
    cut = slice(begin, end)
    warm = None if path.temperature is None else path.temperature[cut]
    x, v, a, command = path.displacement, path.velocity, path.acceleration, path.command
    return Trajectory(path.step, x[cut], v[cut], a[cut], command[cut], path.dead_band, warm)


def in_batches(
    damper: Damper, path: Trajectory, borders: Sequence[int], state: RunState | None = None
) -> np.ndarray:
    edges = [0, *sorted(set(borders)), len(path)]
    edges = [edge for k, edge in enumerate(edges) if not k or edge - edges[k - 1] >= 2 or edge == len(path)]
    forces = []
    for begin, end in pairwise(edges):
        if end - begin < 2:  # a trajectory has two samples or more
            continue
        force, state = simulate_batch(damper, part(path, begin, end), state)
        forces.append(force)
        assert state.answered == sum(map(len, forces)) <= state.taken == end
    return np.concatenate([*forces, finish_run(damper, state or RunState())[0]])


def borders_of(rng: np.random.Generator, length: int) -> list[int]:
    """Return borders at least two samples apart, pieces of two samples among them."""
    steps = np.cumsum(rng.choice([2, 3, 5, 40, 400], length))
    return [int(at) for at in steps if at <= length - 2]


@pytest.mark.system
@pytest.mark.parametrize("name", list(LAWS))
@given(seed=st.integers(0, 10_000), noisy=st.booleans(), commanded=st.booleans())
@examples(12)
def test_batches_give_the_force_of_the_whole_run_to_the_bit(name, seed, noisy, commanded):
    path = random_drive(seed, duration=1.2)
    path = rough(path, seed) if noisy else path
    path = with_command(path, seed) if commanded else path
    d, borders = moved(name), borders_of(np.random.default_rng(seed), len(path))
    np.testing.assert_array_equal(in_batches(d, path, borders), simulate(d, path))


@pytest.mark.parametrize("level", ["baseline", "v3", "v4"])
def test_a_batch_of_two_samples_will_do_on_every_instruction_set(level):
    from mrdamper.core import _kernel

    if level not in _kernel.levels():
        pytest.skip(f"this machine has no {level}")
    path, best = with_command(rough(random_drive(3), 3)), _kernel.level()
    try:
        expected = simulate(moved("double-bouc-wen"), path)
        _kernel.use_level(level)
        found = in_batches(moved("double-bouc-wen"), path, range(2, len(path) - 2, 2))
    finally:
        _kernel.use_level(best)
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize(
    "more",
    [
        {"command_lag_s": 0.03},
        {"actuation": Actuation(0.02, 0.05, 0.004, delay_s=0.0123, play=0.05)},
        {"actuation": Actuation(0.02, 0.02)},
    ],
)
def test_lags_delay_and_play_of_a_command_go_over_the_borders(more):
    path = with_command(random_drive(5))
    stepped = replace(path, command=np.where(path.time % 0.4 < 0.2, path.command, 0.1))
    d = moved("bouc-wen", **more)
    for each in (stepped, replace(path, command=np.full(len(path), 0.3))):
        found = in_batches(d, each, [2, 11, 300, 301, 700])
        np.testing.assert_array_equal(found, simulate(d, each))


def test_a_temperature_that_varies_goes_over_the_borders():
    path = with_command(random_drive(6))
    warm = replace(path, temperature=293.0 + 30.0 * path.time)
    values = {**moved("spencer").coefficients}
    values["inner_viscosity"] = TemperatureDependent(Constant(2500.0), Linear(-0.004))
    d = Damper(LAWS["spencer"], values, temperature_range=(290.0, 320.0))
    np.testing.assert_array_equal(in_batches(d, warm, [100, 900]), simulate(d, warm))


def test_steps_longer_than_the_implicit_laws_like_are_divided_alike():
    path = random_drive(7, rate=100.0, duration=4.0)
    for name in ("lugre", "spencer", "series-valve"):
        whole = simulate(moved(name), open_drive(path, longest_step=1e-3))
        found = in_batches(moved(name), path, [37, 200], RunState(longest_step=1e-3))
        np.testing.assert_array_equal(found, whole)


def test_a_command_that_begins_to_vary_late_gives_the_whole_run_as_well():
    """The law's rho is one number over the first batches, and not over the last."""
    path = rough(random_drive(8), 8)
    command = np.where(path.time > 0.9, 0.2 + path.time, 0.5)
    for name in ("bouc-wen", "double-bouc-wen", "lugre"):
        d, late = moved(name), replace(path, command=command)
        found = in_batches(d, late, range(50, len(path) - 2, 50))
        np.testing.assert_array_equal(found, simulate(d, late))


def test_what_is_held_back_is_less_than_a_rest():
    path = random_drive(9, duration=3.0)
    state, held = RunState(), []
    for begin in range(0, 3000, 100):
        _, state = simulate_batch(moved("bouc-wen"), part(path, begin, begin + 100), state)
        held.append(state.taken - state.answered)
    assert max(held) <= 2  # the furthest sample, and its neighbour where the motion turns


def test_at_rest_patience_ends_and_the_state_stays_right():
    """Noise inside the dead band for long: held samples are answered, and later ones are the whole run's."""
    path, rng = random_drive(10, duration=2.0), np.random.default_rng(10)
    x, v = path.displacement.copy(), path.velocity.copy()
    x[600:1600], v[600:1600] = x[600], 0.0
    x[1600:] += x[600] - path.displacement[1600]
    still = replace(
        path, displacement=x + rng.uniform(-ROUGH, ROUGH, len(x)), velocity=v, dead_band=4.0 * ROUGH
    )
    d = moved("bouc-wen")
    state, whole, held, forces = RunState(patience=150), simulate(d, still), 0, []
    for begin in range(0, 2000, 50):
        force, state = simulate_batch(d, part(still, begin, begin + 50 if begin < 1950 else 2001), state)
        forces.append(force)
        held = max(held, state.taken - state.answered)
    found = np.concatenate([*forces, finish_run(d, state)[0]])
    assert held <= 150
    np.testing.assert_array_equal(found[:600], whole[:600])
    np.testing.assert_array_equal(found[-300:], whole[-300:])
    yielded = d.coefficients["yield_force"].value(np.array([0.5]))[0]
    travel = 1300.0 * still.dead_band  # rho at 0.5 A times the dead band: dw <= (1 + |kappa|) of it
    assert np.abs(found - whole).max() <= 2.0 * yielded * travel


@pytest.mark.parametrize("name", list(LAWS))
def test_a_run_goes_on_from_what_was_kept_of_it(name, tmp_path):
    more = {"actuation": Actuation(0.02, 0.05, 0.004, delay_s=0.0123, play=0.05)}
    path, d = with_command(rough(random_drive(14), 14)), moved(name, **more)
    state, forces = RunState(), []
    for begin in range(0, 1500, 300):
        force, state = simulate_batch(d, part(path, begin, begin + 300 if begin < 1200 else 1501), state)
        forces.append(force)
        for key, values in state.to_arrays().items():
            np.save(tmp_path / f"{key}.npy", values)
        state = RunState.from_arrays({file.stem: np.load(file) for file in tmp_path.glob("*.npy")})
    force, state = finish_run(d, state)
    np.testing.assert_array_equal(np.concatenate([*forces, force]), simulate(d, path))
    assert state.answered == state.taken == len(path)
    kept = state.to_arrays()
    with pytest.raises(InputError, match="the run is over"):
        simulate_batch(d, path, RunState.from_arrays(kept))
    for lacking in ("motion", "held_2"):
        with pytest.raises(InputError, match="state of a run"):
            RunState.from_arrays({key: value for key, value in kept.items() if key != lacking})


def test_a_state_is_a_value_that_two_futures_may_begin_from():
    path, d = random_drive(15), moved("series-valve")
    first, rest = part(path, 0, 400), part(path, 400, len(path))
    force, state = simulate_batch(d, first)
    once, after = simulate_batch(d, rest, state)
    again, _ = simulate_batch(d, rest, state)
    np.testing.assert_array_equal(once, again)
    np.testing.assert_array_equal(np.concatenate([force, once, finish_run(d, after)[0]]), simulate(d, path))


def test_memory_stays_that_of_a_batch():
    """Held arrays are copies: a view of one would keep its whole batch."""
    path, state = random_drive(11, duration=10.0), RunState()
    for begin in range(0, 10_000, 1000):
        _, state = simulate_batch(moved("series-valve"), part(path, begin, begin + 1000), state)
        assert all(column.base is None and len(column) < 1000 for column in state.held)


def test_what_cannot_be_carried_is_refused_in_words():
    path = random_drive(12)
    d = moved("bouc-wen")
    force, over = finish_run(d, RunState())
    assert len(force) == 0
    with pytest.raises(InputError, match="the run is over"):
        simulate_batch(d, path, over)
    _, state = simulate_batch(d, path)
    for other, changed in (("step", replace(path, step=0.5)), ("dead_band", replace(path, dead_band=0.5))):
        with pytest.raises(InputError, match=other):
            simulate_batch(d, changed, state)
    with pytest.raises(InputError, match="patience"):
        RunState(patience=0)
    values = dict(moved("bouc-wen").coefficients) | {"n": Polynomial((1.0, 0.5))}
    bent = Damper(LAWS["bouc-wen"], values)
    _, state = simulate_batch(bent, path)
    with pytest.raises(ValueError, match="kappa and n"):
        simulate_batch(bent, replace(path, command=np.full(len(path), 0.7)), state)


def test_a_state_of_another_batch_is_refused():
    path, law = random_drive(13), LAWS["lugre"].kernel or 0
    motion, state = np.zeros(core.MOTION_NUMBERS), np.zeros(core.STATE_NUMBERS)
    kinematics = (path.displacement, path.velocity, path.acceleration)
    values = np.ascontiguousarray(moved("lugre").coefficients_at(0.5)[:, 0])
    batch = core.open_batch(path.step, kinematics, motion, patience=100)
    assert batch.behind == 0
    state[0] = 1.0
    with pytest.raises(ValueError, match="batch before"):
        core.carry(law, batch, values, state, core.Workspace())
    with pytest.raises(ValueError, match="expected"):
        core.carry(law, batch, values, state[:3].copy(), core.Workspace())
    with pytest.raises(ValueError, match="patience"):
        core.open_batch(path.step, kinematics, motion, patience=0)


@pytest.mark.parametrize("command_drifts", [False, True])
@pytest.mark.parametrize("warms", [False, True])
def test_batches_along_which_command_or_temperature_stands_still_are_the_whole_run(command_drifts, warms):
    """What stands still is worked out once; what drifts beside it is not taken to stand still."""
    path = random_drive(3)
    drift = np.linspace(0.0, 1.0, len(path))
    path = replace(path, command=0.5 + command_drifts * drift, temperature=300.0 + 60.0 * warms * drift)
    damper = moved("bouc-wen")
    forms = {
        **damper.coefficients,
        "yield_force": TemperatureDependent(Polynomial((100.0, 300.0)), Linear(2e-3)),
    }
    damper = Damper(damper.law, forms)
    assert (in_batches(damper, path, [40, 90, 200]) == simulate(damper, path)).all()
