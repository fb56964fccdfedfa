"""The reference integrator agrees with closed forms and limits, and simulates user-defined laws."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad, solve_ivp

from mrdamper.errors import InputError
from mrdamper.excitation import Harmonics, Sine, Trajectory, drive
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant, Exponential, Polynomial
from mrdamper.models.laws import LAWS, Coefficient, PythonLaw
from mrdamper.models.python_law import law_from_python, load_python_law
from tests.oracles.reference import (
    bouc_wen_closed_form,
    bouc_wen_distance,
    bouc_wen_state,
    simulate_reference,
    turning_points,
)
from tests.support.examples import examples

THREE_TONES = Harmonics((4e-3, 2e-3, 1e-3), (2.0, 5.3, 11.0), (0.0, 1.0, 2.0))
# This motion has inner loops with additional reversals.
UNEVEN = drive(THREE_TONES, duration=0.25, rate_Hz=1000.0, command=0.5)
SINE = drive(Sine(0.01, 2.0), duration=1.0, rate_Hz=400.0, command=0.5)  # The motion has two periods.

SOUND = {  # These laws are odd in the motion and have realistic coefficients.
    "bouc-wen": {"viscosity": 900.0, "yield_force": 500.0, "rho": 1200.0, "kappa": -0.9, "n": 1.3},
    "dahl": {"viscosity": 900.0, "yield_force": 500.0, "rho": 1200.0},
    "bouc-wen-saturating": {
        "yield_force": 300.0,
        "rate_force": 400.0,
        "saturation_velocity": 0.02,
        "rho": 3000.0,
        "kappa": -0.99,
        "n": 0.3,
    },
    "double-bouc-wen": {
        **{
            "viscosity": 900.0,
            "yield_force": 300.0,
            "second_force": 200.0,
            "rho": 3000.0,
            "second_rho": 500.0,
        },
        **{"kappa": -0.9, "n": 1.3},
    },
    "bingham": {"viscosity": 900.0, "yield_force": 500.0, "yield_velocity": 2e-3},
    "tanh": {"viscosity": 900.0, "yield_force": 500.0, "slope": 200.0, "shift": 0.0},
    "lugre": {
        **{"viscosity": 900.0, "yield_force": 500.0, "rho": 1200.0},
        **{"static_excess": 0.5, "fade_velocity": 0.01, "bristle_damping": 1500.0},
    },
    "spencer": {
        **{"yield_force": 500.0, "series_damping": 3e4, "inner_viscosity": 900.0, "inner_stiffness": 4e3},
        **{"rho": 1200.0, "kappa": -0.9, "n": 1.3},
    },
    "series-valve": {
        "yield_force": 400.0,
        "thinning": 3.2,
        "thinning_exponent": 0.43,
        "yield_velocity": 2.5e-3,
        "position_gain": 0.0,
        "gap_stiffness": 1.2e7,
        "gap": 1.7e-4,
        "gap_corner": 4.6e-5,
        "leak_damping": 3e4,
    },
    "chain": {
        **{"yield_force": 400.0, "yield_velocity": 2.5e-3, "thinning": 0.8, "thinning_exponent": 0.43},
        **{"gap_stiffness": 1.2e7, "gap": 1.7e-4, "gap_corner": 4.6e-5, "leak_damping": 3e4},
        **{"bristle_share": 0.4, "bristle_stiffness": 2e6, "friction_force": 40.0, "memory_force": 30.0},
    },
}


def damper(law, /, **values):
    parameters = {**SOUND[law], **values}
    forms = {name: Constant(v) if isinstance(v, float) else v for name, v in parameters.items()}
    return Damper(LAWS[law], forms)


shapes = {"kappa": st.floats(-1.0, 0.99), "n": st.floats(0.2, 20.0)}


# ----------------------------------------------------------------------------------- closed form of the curve


@given(st.floats(0.0, 0.999999))
def test_hysteresis_curve_is_elementary_for_integer_exponents(w):
    assert bouc_wen_distance(w, 0.3, 1.0) == pytest.approx(-math.log1p(-w), rel=1e-9, abs=1e-300)
    assert bouc_wen_distance(w, 0.3, 2.0) == pytest.approx(math.atanh(w), rel=1e-9, abs=1e-300)
    assert bouc_wen_distance(-w, -1.0, 1.0) == pytest.approx(-math.log1p(w), rel=1e-13, abs=1e-300)
    assert bouc_wen_distance(-w, -1.0, 2.0) == pytest.approx(-math.atan(w), rel=1e-13, abs=1e-300)
    assert bouc_wen_distance(-w, 0.0, 1.7) == pytest.approx(-w, rel=1e-13)


@given(st.floats(0.2, 20.0), st.floats(1e-15, 0.9))
def test_hysteresis_curve_equals_its_integral(n, gap):
    """The reference is a quadrature because SciPy's 2F1 is wrong by 20 % at n = 0.3, w = 0.999."""
    w = 1.0 - gap
    # The substitution u = 1 - exp(-y) turns the logarithmic end into a smooth integrand.
    far = -math.log(1.0 - w)
    integral, _ = quad(
        lambda y: math.exp(-y) / -math.expm1(n * math.log1p(-math.exp(-y))), 0, far, epsabs=1e-13
    )
    slope = -1.0 / math.expm1(n * math.log(w))
    assert bouc_wen_distance(w, 0.0, n) == pytest.approx(integral, rel=1e-10, abs=1e-14 * slope)


def test_turning_points_of_sine_are_crests():
    """The crests of the cubic interpolant of a sine are accurate to fourth order in the step."""
    crests = 0.01 * np.array([1.0, -1.0, 1.0, -1.0])
    errors = []
    for rate_Hz in (101.0, 202.0):  # The crests are between two samples.
        trajectory = drive(Sine(0.01, 2.0), duration=1.0, rate_Hz=rate_Hz, command=0.0)
        found = [x for _, x in turning_points(trajectory)]
        errors.append(np.abs(found - crests).max())
    assert errors[0] < 2e-8
    assert errors[1] < errors[0] / 12


# ------------------------------------------------------------ integrator compared with the closed form


@pytest.mark.system
@examples(12)
@given(rho=st.floats(10.0, 1e5), kappa=st.floats(-1.0, 0.9), n=shapes["n"])
def test_reference_integrator_agrees_with_formula(rho, kappa, n):
    """The largest kappa is 0.9. At kappa = 1, w stays close to its bound, which amplifies errors."""
    values = {"viscosity": 0.0, "yield_force": 1.0, "rho": rho, "kappa": kappa, "n": n}
    w = simulate_reference(damper("bouc-wen", **values), UNEVEN)
    exact = bouc_wen_closed_form(UNEVEN.displacement, turning_points(UNEVEN), rho=rho, kappa=kappa, n=n)
    np.testing.assert_allclose(w, exact, rtol=0, atol=1e-8)
    assert np.abs(w).max() <= 1.0 + 1e-10


def test_hysteresis_state_is_constant_at_rest():
    t = np.arange(0, 0.6, 2e-3)
    there = np.where(t < 0.2, np.cos(2 * np.pi * 5 * t), 1.0)
    again = np.where(t >= 0.4, np.cos(2 * np.pi * 5 * (t - 0.4)), there)
    moving = (t < 0.2) | (t >= 0.4)
    x = 5e-3 * again
    v = np.where(moving, -5e-3 * 10 * np.pi * np.sin(10 * np.pi * (t % 0.2)), 0.0)
    v[np.abs(v) < 1e-12] = 0.0
    path = Trajectory(2e-3, x, v, np.zeros_like(x), np.zeros_like(x))
    shape = {"rho": 900.0, "kappa": -0.5, "n": 2.0}
    w = simulate_reference(damper("bouc-wen", viscosity=0.0, yield_force=1.0, **shape), path)
    np.testing.assert_allclose(w, bouc_wen_closed_form(x, turning_points(path), **shape), rtol=0, atol=1e-8)
    assert np.ptp(w[(t > 0.201) & (t < 0.399)]) < 1e-12


def test_hysteresis_curve_is_independent_of_varying_rho():
    """In a stroke without reversal, w = Y(integral of rho dx) for any variation of rho with the command."""
    t = np.arange(0, 0.2001, 1e-3)
    x, v = 0.02 * t + 0.05 * t**2, 0.02 + 0.1 * t
    command = np.where(t < 0.05, 0.0, np.where(t < 0.1, 1.0, 0.3))
    path = Trajectory(1e-3, x, v, np.full_like(t, 0.1), command)
    forms = damper("bouc-wen", viscosity=0.0, yield_force=1.0, rho=Exponential(900.0, -1.5), kappa=0.0, n=1.5)
    w = simulate_reference(forms, path)
    travel = [0.0]
    for k in range(len(t) - 1):
        part, _ = quad(
            lambda s, k=k: 900.0 * np.exp(-1.5 * np.interp(s, t, command)) * (0.02 + 0.1 * s), t[k], t[k + 1]
        )
        travel.append(travel[-1] + part)
    np.testing.assert_allclose(w, [bouc_wen_state(each, 0.0, 1.5) for each in travel], rtol=0, atol=1e-8)


# ---------------------------------------------------------------------------------------- limits of the chain


def test_linear_series_valve_is_maxwell_element():
    """With a linear valve and no free play, the law is a Maxwell element.

    The equation for the travel y of the valve is k (x - y) + c (x' - y') = f0 + k0 y + D (1 + b x) y'.
    """
    k, c, f0, k0, b, large = 2e5, 300.0, 40.0, 9e3, -30.0, 1e4
    valve = {"yield_force": 1.0, "yield_velocity": 10.0, "thinning": large, "thinning_exponent": 1.0}
    chain = {"gap_stiffness": k, "gap": 0.0, "gap_corner": 1e-9, "leak_damping": c}
    model = damper("series-valve", **valve, **chain, offset=f0, stiffness=k0, position_gain=b)

    def sine(t):
        return 0.01 * np.sin(4 * np.pi * t), 0.04 * np.pi * np.cos(4 * np.pi * t)

    def y_rate(t, y):
        x, v = sine(t)
        return (k * (x - y) + c * v - f0 - k0 * y) / ((large + 0.1) * (1 + b * x) + c)

    fine = drive(Sine(0.01, 2.0), duration=0.5, rate_Hz=2000.0, command=0.0)
    y = solve_ivp(y_rate, (0.0, 0.5), [0.0], t_eval=fine.time, rtol=1e-10, atol=1e-14).y[0]
    x, v = sine(fine.time)
    expected = k * (x - y) + c * (v - y_rate(fine.time, y))
    np.testing.assert_allclose(simulate_reference(model, fine), expected, atol=1e-6 * np.abs(expected).max())


def test_motion_inside_free_play_has_dashpot_force():
    """Within the free play, only the dashpot has a force, for any valve force."""
    small = drive(Sine(1e-4, 1.0), duration=1.0, rate_Hz=200.0, command=0.0)
    wide = damper("series-valve", gap=0.05, gap_corner=1e-6, yield_force=1e7, leak_damping=2e3)
    np.testing.assert_allclose(simulate_reference(wide, small), 2e3 * small.velocity, atol=1e-3)


# -------------------------------------------------------------------------------- user-defined laws


class OwnBoucWen:
    """A user-defined law: the Bouc-Wen model with coefficients that are not normalised."""

    name = "own-bouc-wen"
    coefficients = (
        Coefficient("A", "-", "slope", linear=False),
        Coefficient("beta", "1/m^n", "shape", linear=False),
        Coefficient("gamma", "1/m^n", "shape", linear=False),
        Coefficient("n", "-", "sharpness", linear=False, default=2.0),
        Coefficient("alpha", "N/m", "force per state", linear=True),
    )

    def rate(self, state, displacement, velocity, values):
        z, n = state, values["n"]
        bent = (
            values["beta"] * abs(velocity) * abs(z) ** (n - 1) * z + values["gamma"] * velocity * abs(z) ** n
        )
        return values["A"] * velocity - bent

    def force(self, state, displacement, velocity, values):
        return values["alpha"] * state


def test_textbook_bouc_wen_equals_normalised_law():
    """With z_m = (A / (beta + gamma))^(1/n), rho is A / z_m, and kappa is (gamma - beta) / (gamma + beta)."""
    law = law_from_python(OwnBoucWen())
    values = {"A": 10.0, "beta": 3e6, "gamma": 1e6, "alpha": 4e5}
    own = Damper(law, {name: Constant(value) for name, value in values.items()})
    z_m = math.sqrt(10.0 / 4e6)
    same = damper("bouc-wen", viscosity=0.0, yield_force=4e5 * z_m, rho=10.0 / z_m, kappa=-0.5, n=2.0)
    np.testing.assert_allclose(
        simulate_reference(own, UNEVEN), simulate_reference(same, UNEVEN), atol=1e-6 * 4e5 * z_m
    )
    assert isinstance(law.python, PythonLaw)
    assert law.title == "A user-defined law: the Bouc-Wen model with coefficients that are not normalised."


LAW_FILE = '''
from mrdamper.models.laws import Coefficient

class Dashpot:
    """A dashpot."""
    name = "dashpot"
    coefficients = (Coefficient("c", "N s/m", "damping", linear=True),)

    def rate(self, state, displacement, velocity, values):
        return 0.0

    def force(self, state, displacement, velocity, values):
        return values["c"] * velocity

class Taken(Dashpot):
    name = "bingham"

class Bare:
    name = "bare"

class Twice(Dashpot):
    coefficients = Dashpot.coefficients * 2

class Raises:
    def __init__(self):
        raise RuntimeError("no licence")
'''


@pytest.fixture
def law_file(tmp_path):
    path = tmp_path / "my_laws.py"
    path.write_text(LAW_FILE, encoding="utf-8")
    return path


def test_python_law_is_loaded_from_file(law_file):
    law = load_python_law(f"{law_file}:Dashpot")
    assert (law.name, law.title, law.kernel) == ("dashpot", "A dashpot.", None)
    model = Damper(law, {"c": Polynomial((100.0, 50.0))})
    np.testing.assert_allclose(simulate_reference(model, SINE), 125.0 * SINE.velocity)


@pytest.mark.parametrize(
    ("after", "said"),
    [
        ("", "expected path/to/file.py:ClassName"),
        (":", "expected path/to/file.py:ClassName"),
        (":Dashpt", "has no class Dashpt; it has Coefficient, Dashpot, Taken, Bare, Twice, Raises"),
        (":Taken", "name is 'bingham'; choose one that is not bouc-wen, dahl"),
        (":Bare", "no coefficients or rate or force"),
        (":Twice", r"coefficients must be Coefficient\(...\) with different names"),
        (":Raises", "RuntimeError: no licence"),
    ],
)
def test_invalid_python_law_file_is_rejected(law_file, after, said):
    with pytest.raises(InputError, match=said):
        load_python_law(f"{law_file}{after}")
