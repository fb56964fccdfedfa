"""Fits of rheometer tables: known laws recovered, standard errors honest, one law found in another."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import curve_fit

from mrdamper.errors import InputError
from mrdamper.models.fluids.carlson import Carlson, FIELD_SCALE_A_m, field_strength
from mrdamper.models.fluids.rheometer import aicc_of, covariance_of, enlargement_of, fall_of
from mrdamper.models.fluids.viscosity_fit import fit_viscosity
from mrdamper.models.fluids.yield_fit import fit_yield_stress
from mrdamper.models.temperature import Arrhenius, Linear, Reynolds, Vft

KELVIN = np.linspace(293.15, 403.15, 23)
LAWS = (Arrhenius(1435.5), Reynolds(0.013), Vft(753.0, 165.4))
FIELDS = np.repeat(field_strength([0.1, 0.2, 0.4, 0.6], 0.32), 6)  # the paper's
AT = np.tile(np.linspace(293.15, 393.15, 6), 4)


def named(study, kind):
    return next(fit for fit in study.fits if fit.factor.kind == kind)


NOTES = {
    "fall_extrapolated": "the fall from 20 to 100 degC is extrapolated",
    "viscosity_rises": "the viscosity rises with temperature",
    "field_scale_kept": "field scale was kept",
    "saturation_extrapolated": "saturation is extrapolated",
    "yield_stress_rises": "the yield stress rises with temperature",
}


def kinds_of(notes: Any) -> list[str]:
    return [kind for note in notes for kind, words in NOTES.items() if words in note]


def noisy(values, seed, share=0.02):
    return values * np.exp(share * np.random.default_rng(seed).standard_normal(np.shape(values)))


# ------------------------------------------------------------------------------------------- viscosity


@pytest.mark.parametrize("law", LAWS)
def test_without_noise_the_law_comes_back(law):
    study = fit_viscosity(KELVIN, 0.15 * law.value(KELVIN))
    fit = named(study, law.kind)
    assert fit.viscosity_Pa_s == pytest.approx(0.15, rel=1e-9)
    assert fit.factor.parameters == pytest.approx(law.parameters, rel=1e-6)
    assert fit.rms_percent < 1e-9
    assert study.best.factor.kind == law.kind


@pytest.mark.parametrize("law", LAWS)
def test_the_truth_lies_within_three_standard_errors(law):
    """20 tables of 23 points, 2 % of noise: at most 3 % of the numbers further off, their spread near 1."""
    found = []
    for seed in range(20):
        fit = named(fit_viscosity(KELVIN, noisy(0.15 * law.value(KELVIN), seed)), law.kind)
        truth = (0.15, *law.parameters)
        found += [(n.value - t) / n.standard_error for n, t in zip(fit.parameters, truth, strict=True)]
        fall, error = fit.fall_percent()
        found.append((fall - 100.0 * (1.0 - float(law.value(373.15)))) / error)
    scores = np.array(found)
    assert np.mean(np.abs(scores) > 3.0) <= 0.03
    assert 0.7 < np.sqrt(np.mean(scores**2)) < 1.4


def test_vft_recovers_arrhenius_when_the_data_are_arrhenius():
    law = Arrhenius(1435.5)
    clean = named(fit_viscosity(KELVIN, 0.15 * law.value(KELVIN)), "vft")
    assert clean.factor.vft_pole_K == pytest.approx(0.0, abs=1e-6)
    assert clean.factor.vft_K == pytest.approx(1435.5, rel=1e-9)
    for seed in range(5):
        fit = named(fit_viscosity(KELVIN, noisy(0.15 * law.value(KELVIN), seed, 0.005)), "vft")
        assert abs(fit.factor.vft_pole_K) < 3.0 * fit.parameters[2].standard_error


@pytest.mark.parametrize("law", LAWS)
def test_the_law_of_the_table_is_chosen_in_most_tables(law):
    """AICc takes a law with one number more for chance in about one table of ten."""
    chosen = [
        fit_viscosity(KELVIN, noisy(0.15 * law.value(KELVIN), seed)).best.factor.kind for seed in range(20)
    ]
    assert chosen.count(law.kind) >= 15


@pytest.mark.system
@given(
    scale=st.floats(1e-3, 1e3),
    order=st.permutations(range(8)),
    rate=st.floats(0.002, 0.03),
    seed=st.integers(0, 99),
)
def test_the_unit_and_the_order_of_the_points_do_not_matter(scale, order, rate, seed):
    kelvin = np.linspace(300.0, 390.0, 8)
    viscosity = noisy(0.1 * Reynolds(rate).value(kelvin), seed)
    one = fit_viscosity(kelvin, viscosity).fits
    other = fit_viscosity(kelvin[order], scale * viscosity[order]).fits
    assert {fit.factor.kind for fit in one} == {fit.factor.kind for fit in other}
    for kind in ("arrhenius", "reynolds"):
        a, b = (next(fit for fit in fits if fit.factor.kind == kind) for fits in (one, other))
        assert b.viscosity_Pa_s == pytest.approx(scale * a.viscosity_Pa_s, rel=1e-9)
        assert b.factor.parameters == pytest.approx(a.factor.parameters, rel=1e-9)


def test_the_arrhenius_fit_is_the_straight_line_of_a_textbook():
    """Ln eta over 1/T by numpy.polyfit, with its covariance."""
    viscosity = noisy(0.15 * Arrhenius(1435.5).value(KELVIN), 1)
    (slope, _), covariance = np.polyfit(1.0 / KELVIN - 1.0 / 293.15, np.log(viscosity), 1, cov=True)
    fit = named(fit_viscosity(KELVIN, viscosity), "arrhenius")
    assert fit.factor.activation_K == pytest.approx(slope, rel=1e-9)
    assert fit.enlarged == 1.0
    assert fit.parameters[1].standard_error == pytest.approx(math.sqrt(covariance[0, 0]), rel=1e-6)


@pytest.mark.parametrize("kind", ["viscosity", "yield stress"])
def test_a_law_of_three_numbers_is_that_of_a_general_fit_of_logarithms_with_its_covariance(kind):
    """By scipy.optimize.curve_fit, which works out its derivatives from differences."""
    if kind == "viscosity":
        table = noisy(0.15 * Vft(753.0, 165.4).value(KELVIN), 3)
        fit = named(fit_viscosity(KELVIN, table), "vft")

        def law(kelvin, level, rate, pole):
            return np.log(level) + rate * 100.0 * (
                1.0 / (kelvin - pole * 100.0) - 1.0 / (293.15 - pole * 100.0)
            )

        at: Any = KELVIN
        start, units = (0.2, 8.0, 1.5), np.array([1.0, 100.0, 100.0])
    else:
        table = noisy(Carlson(4e4, 1.1e5).stress(FIELDS) * Linear(1.5e-3).value(AT), 3)
        study = fit_yield_stress(FIELDS, AT, table)
        fit = next(fit for fit in study.fits if fit.name == "carlson-free-scale")

        def law(place, saturation, scale, slope):
            field, kelvin = place
            stress = saturation * 1e4 * np.tanh(field / (1e5 * scale))
            return np.log(stress * (1.0 - 1e-3 * slope * (kelvin - 293.15)))

        at = (FIELDS, AT)
        start, units = (3.0, 1.5, 1.0), np.array([1e4, 1e5, 1e-3])
    values, covariance = curve_fit(law, at, np.log(table), start, xtol=1e-14, ftol=1e-14)
    assert [each.value for each in fit.parameters] == pytest.approx(values * units, rel=1e-5)
    enlarged = getattr(fit, "enlarged", 1.0)
    outer = np.outer(units, units) * enlarged**2
    spread = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(spread, spread)
    assert fit.covariance / outer / np.outer(spread, spread) == pytest.approx(correlation, abs=1e-3)
    assert [each.standard_error for each in fit.parameters] == pytest.approx(
        enlarged * units * np.sqrt(np.diag(covariance)), rel=1e-3
    )
    left = np.log(table) - law(at, *values)
    order = np.lexsort((AT, FIELDS)) if kind == "yield stress" else np.arange(len(left))
    assert np.abs(fit.residual) == pytest.approx(np.abs(left[order]), abs=1e-6)
    assert fit.rms_percent == pytest.approx(100.0 * np.sqrt(np.mean(left**2)), rel=1e-6)
    n, k = len(left), 4  # three numbers and the scatter
    aicc = n * np.log(np.mean(left**2)) + 2 * k + 2 * k * (k + 1) / (n - k - 1)
    assert fit.aicc == pytest.approx(aicc, rel=1e-9)


def test_a_collapse_above_130_degC_is_left_out_and_told():
    kelvin = 273.15 + np.arange(20.0, 151.0, 5.0)
    law = Arrhenius(1435.5)
    collapsing = 0.153 * law.value(kelvin) / (1.0 + np.exp((kelvin - 414.15) / 1.5))
    study = fit_viscosity(kelvin, collapsing, place="table.csv")
    assert named(study, "arrhenius").factor.activation_K == pytest.approx(1435.5, rel=1e-3)
    assert study.used.sum() == np.sum(kelvin <= 403.15 + 1e-9)
    assert any("4 points above 130 degC left out" in note for note in study.notes)
    assert any("the fluid fails there" in note for note in study.notes)


def test_a_table_that_goes_on_above_130_degC_as_its_law_says_is_not_called_failing():
    kelvin = 273.15 + np.arange(20.0, 151.0, 5.0)
    study = fit_viscosity(kelvin, noisy(0.153 * Arrhenius(1435.5).value(kelvin), 4))
    assert any("left out" in note for note in study.notes)
    assert not any("fails" in note for note in study.notes)


def test_points_that_do_not_reach_from_20_to_100_degC_make_the_fall_an_extrapolation():
    kelvin = np.linspace(303.15, 353.15, 10)
    notes = fit_viscosity(kelvin, Arrhenius(1400.0).value(kelvin)).notes
    assert any(
        "points lie at 30 to 80 degC: the fall from 20 to 100 degC is extrapolated" in n for n in notes
    )


def test_a_viscosity_that_curves_the_other_way_sends_the_pole_to_its_limit_and_says_so():
    """Ln eta concave in T: no VFT law does that, Reynolds' law is the nearest."""
    x = KELVIN - 293.15
    study = fit_viscosity(KELVIN, noisy(0.2 * np.exp(-0.005 * x - 6e-5 * x**2), 2, 0.002))
    assert "Reynolds' law" in named(study, "vft").limit
    assert math.isnan(named(study, "vft").parameters[2].standard_error)
    assert study.best.factor.kind == "reynolds"


def test_points_that_err_together_get_larger_standard_errors():
    """First-order autoregressive scatter, r = 0.8: means are sqrt(1.8 / 0.2) = 3 times as open."""
    rng = np.random.default_rng(5)
    grown = []
    for _ in range(20):
        noise = np.zeros(400)
        for k in range(1, 400):
            noise[k] = 0.8 * noise[k - 1] + rng.standard_normal()
        grown.append(enlargement_of(noise))
    assert np.mean(grown) == pytest.approx(3.0, rel=0.1)


def test_points_that_err_alone_seldom_get_larger_standard_errors():
    rng = np.random.default_rng(6)
    grown = [enlargement_of(rng.standard_normal(50)) for _ in range(200)]
    assert np.mean(np.array(grown) > 1.0) < 0.06


@pytest.mark.parametrize("points", [3, 4, 5])
def test_few_points_are_fitted_without_the_law_of_three_numbers(points):
    kelvin = np.linspace(293.15, 373.15, points)
    study = fit_viscosity(kelvin, noisy(0.1 * Reynolds(0.01).value(kelvin), 3))
    assert {fit.factor.kind for fit in study.fits} == {"arrhenius", "reynolds"}
    assert any("VFT law was not fitted" in note for note in study.notes)
    assert all(math.isfinite(n.standard_error) for fit in study.fits for n in fit.parameters)


@pytest.mark.parametrize(
    ("kelvin", "viscosity", "said"),
    [
        ([293.15] * 4, [0.1] * 4, r"one temperature \(20 degC\) within -40 to 130 degC; expected at least 3"),
        ([293.15, 333.15], [0.1, 0.05], r"2 temperatures \(20 to 60 degC\).*a viscosity law has 2 numbers"),
        ([293.15, 295.0, 297.0], [0.1, 0.09, 0.08], "3 temperatures.*10 K or more apart"),
        ([420.0, 430.0, 440.0], [0.1, 0.05, 0.04], "no temperature within -40 to 130 degC"),
        (
            [293.15, 313.15, 333.15],
            [0.1, -0.05, 0.04],
            r"viscosity is -0\.05 Pa s at 40 degC \(1 such point\)",
        ),
        ([293.15, 313.15, 333.15], [0.1, 0.0, 0.04], "viscosity is 0 Pa s at 40 degC"),
        ([293.15, 313.15, 333.15], [0.1, math.inf, 0.04], "viscosity is inf Pa s at 40 degC"),
    ],
)
def test_a_table_that_tells_no_law_is_refused_with_the_remedy(kelvin, viscosity, said):
    with pytest.raises(InputError, match=said):
        fit_viscosity(np.array(kelvin), np.array(viscosity))


def test_a_table_of_six_temperatures_from_20_to_100_degC_is_fitted_by_all_laws_and_nothing_is_noted():
    """Within 2 K of the ends the fall is not called extrapolated."""
    for ends, noted in (((0.0, 80.0), []), ((2.0, 78.0), []), ((2.1, 78.0), 1), ((2.0, 77.9), 1)):
        kelvin = np.linspace(293.15 + ends[0], 293.15 + ends[1], 6)
        kelvin[[0, -1]] = 293.15 + ends[0], 373.15 - (80.0 - ends[1])
        study = fit_viscosity(kelvin, 0.1 * Arrhenius(1400.0).value(kelvin))
        assert len(study.fits) == 3
        assert kinds_of(study.notes) == (["fall_extrapolated"] if noted else [])


def test_a_viscosity_that_rises_is_noted():
    notes = fit_viscosity(KELVIN, 0.1 * Reynolds(-0.001).value(KELVIN)).notes
    assert kinds_of(notes) == ["viscosity_rises"]


@pytest.mark.parametrize("waves", [1.0, 4.0])
def test_errors_of_neighbours_together_are_noted_with_what_they_enlarge(waves):
    wave = np.exp(0.02 * np.sin(2.0 * np.pi * waves * np.arange(23.0) / 23.0))
    study = fit_viscosity(KELVIN, 0.15 * Arrhenius(1435.5).value(KELVIN) * wave)
    note: Any
    (note,) = study.notes
    assert f"enlarged by {study.best.enlarged:.2g}" in note
    assert study.best.enlarged == enlargement_of(study.best.residual) > 1.0


@pytest.mark.parametrize(
    ("at_degC", "shares", "noise", "fails", "said"),
    [
        ((-50.0,), (1.3,), 0.0, False, ("1 point below -40", "-50", "+30")),
        ((-50.0,), (0.8,), 0.0, False, ("1 point below -40", "-50", "-20")),
        ((130.5, 140.0), (0.89, 0.95), 0.0, True, ("2 points above 130", "130.5", "-11")),
        ((131.0, 140.0), (1.12, 0.91), 0.0, False, ("2 points above 130", "131", "+12")),
        ((140.0,), (0.85,), 0.04, False, ("1 point above 130", "140", "-")),
    ],
)
def test_points_outside_are_told_with_the_one_that_is_furthest_from_the_law(
    at_degC, shares, noise, fails, said
):
    """More than a tenth below the law above 130 degC is a failing fluid, or five times the scatter."""
    law, outside = Reynolds(0.013), 273.15 + np.array(at_degC)
    inside = 0.15 * law.value(KELVIN) * np.exp(noise * np.array([*([1.0, -1.0] * 11), 0.0]))
    kelvin = np.concatenate([outside, KELVIN])
    study = fit_viscosity(kelvin, np.concatenate([0.15 * law.value(outside) * shares, inside]), place="t.csv")
    note: Any
    (note,) = study.notes
    assert ("the fluid fails" in note) is fails
    points, at, percent = said
    head = f"t.csv: {points} degC left out of the laws; at {at} degC the table is {percent}"
    assert note.startswith(head)
    assert study.best.factor.kind == "reynolds"


@pytest.mark.parametrize(("from_degC", "pole_degC"), [(20.0, 15.0), (0.0, -5.0), (40.0, 15.0)])
def test_a_pole_rests_5_K_below_the_coldest_of_the_points_and_20_degC(from_degC, pole_degC):
    """The table is that of a pole 1 K higher; the two numbers left are a straight line's."""
    kelvin = np.linspace(273.15 + from_degC, 403.15, 20)
    table = 0.1 * np.exp(300.0 / (kelvin - 274.15 - pole_degC))
    fit = named(fit_viscosity(kelvin, table), "vft")
    assert fit.limit == "its pole rests 5 K below the coldest point"
    assert fit.factor.vft_pole_K == pytest.approx(273.15 + pole_degC)
    slope, level = np.polyfit(1.0 / (kelvin - 273.15 - pole_degC), np.log(table), 1)
    assert fit.factor.vft_K == pytest.approx(slope, rel=1e-8)
    assert math.log(fit.viscosity_Pa_s) == pytest.approx(level + slope / (20.0 - pole_degC), rel=1e-8)
    assert [math.isnan(each.standard_error) for each in fit.parameters] == [False, False, True]


def test_a_pole_that_is_inside_its_limits_by_little_is_fitted():
    kelvin = np.linspace(273.15, 403.15, 20)
    fit = named(fit_viscosity(kelvin, 0.1 * Vft(300.0, 267.0).value(kelvin)), "vft")
    assert fit.limit == ""
    assert fit.factor.vft_pole_K == pytest.approx(267.0, abs=1e-4)


@pytest.mark.parametrize(
    ("kelvin", "refused"),
    [
        ([300.0, 305.0, 310.0], False),
        ([300.0, 305.0, 309.9], True),
        ([300.0, 300.04, 310.0], True),  # one temperature, to a tenth
        ([300.0, 300.1, 310.0], False),
    ],
)
def test_three_temperatures_over_10_K_tell_a_law(kelvin, refused):
    if refused:
        with pytest.raises(InputError, match="at least 3, 10 K or more apart"):
            fit_viscosity(np.array(kelvin), np.array([0.3, 0.2, 0.1]))
    else:
        assert len(fit_viscosity(np.array(kelvin), np.array([0.3, 0.2, 0.1])).fits) == 2


def test_neighbours_err_together_where_their_correlation_is_above_what_chance_gives():
    """R is 7/8 of eight equal residuals; half where every third is nothing, 2/sqrt(16) of sixteen."""
    assert enlargement_of(np.ones(7)) == 1.0
    assert enlargement_of(np.ones(8)) == pytest.approx(math.sqrt(1.875 / 0.125))
    assert enlargement_of(np.array([1.0, 1.0, 0.0] * 5 + [0.0])) == 1.0
    assert enlargement_of(np.array([1.0, 1.0, 0.0] * 6)) == pytest.approx(math.sqrt(1.5 / 0.5))
    assert enlargement_of(np.full(20, 1e-13)) == 1.0  # rounding
    assert enlargement_of(np.full(20, 1e-11)) > 1.0


def test_rounding_counts_as_scatter_of_1e_12_and_too_few_points_judge_no_law():
    """With K numbers, the scatter among them, AICc is n ln(mean square) + 2 K n / (n - K - 1)."""
    for scatter, counted in ((0.0, 1e-12), (1e-13, 1e-12), (1.5e-12, 1.5e-12), (0.1, 0.1)):
        aicc = aicc_of(np.full(8, scatter), 2)
        assert aicc == pytest.approx(16.0 * math.log(counted) + 2.0 * 3.0 * 8.0 / 4.0)
    assert aicc_of(np.full(4, 0.1), 2) == math.inf
    assert aicc_of(np.full(5, 0.1), 2) == pytest.approx(10.0 * math.log(0.1) + 30.0)


def test_as_many_numbers_as_points_have_no_errors_and_one_point_more_gives_them():
    columns, residual = np.array([[1.0, 0.0], [1.0, 1.0], [1.0, 2.0]]), np.array([1.0, -2.0, 1.0])
    assert np.isnan(covariance_of(columns[:2], residual[:2])).all()
    found = covariance_of(columns, residual)
    assert found == pytest.approx(6.0 * np.linalg.inv(columns.T @ columns))


# ------------------------------------------------------------------------------------------- yield stress


@pytest.mark.parametrize(("scale", "name"), [(FIELD_SCALE_A_m, "carlson"), (1.1e5, "carlson-free-scale")])
def test_without_noise_the_yield_stress_law_comes_back(scale, name):
    stress = Carlson(47e3, scale).stress(FIELDS) * Linear(1.67e-3).value(AT)
    best = fit_yield_stress(FIELDS, AT, stress).best
    assert best.name == name
    assert best.field_law.saturation_Pa == pytest.approx(47e3, rel=1e-7)
    assert best.field_law.field_scale_A_m == pytest.approx(scale, rel=1e-7)
    assert best.factor.temperature_slope == pytest.approx(1.67e-3, rel=1e-6)
    assert best.fall_percent()[0] == pytest.approx(100.0 * 80.0 * 1.67e-3, rel=1e-6)


@pytest.mark.parametrize(("scale", "name"), [(FIELD_SCALE_A_m, "carlson"), (1.1e5, "carlson-free-scale")])
def test_the_true_yield_stress_lies_within_three_standard_errors(scale, name):
    scores = []
    clean = Carlson(47e3, scale).stress(FIELDS) * Linear(1.5e-3).value(AT)
    for seed in range(20):
        study = fit_yield_stress(FIELDS, AT, noisy(clean, seed))
        fit = next(fit for fit in study.fits if fit.name == name)
        for number, truth in zip(fit.parameters, (47e3, scale, 1.5e-3), strict=True):
            if name == "carlson" and number.name == "field_scale_A_m":
                assert math.isnan(number.standard_error)  # it was not fitted
                continue
            scores.append((number.value - truth) / number.standard_error)
    assert np.mean(np.abs(scores) > 3.0) <= 0.03
    assert 0.7 < np.sqrt(np.mean(np.square(scores))) < 1.4


def test_points_without_field_and_above_130_degC_stay_out_and_are_told():
    field = np.append(FIELDS, [0.0, 5e4])
    kelvin = np.append(AT, [293.15, 420.0])
    stress = Carlson(47e3).stress(field) * Linear(1.5e-3).value(kelvin)
    study = fit_yield_stress(field, kelvin, stress, place="tau.csv")
    assert study.used.sum() == FIELDS.size
    assert any("1 point without field left out" in note for note in study.notes)
    assert any("1 point outside -40 to 130 degC left out" in note for note in study.notes)


def test_weak_fields_leave_the_saturation_open_and_say_so():
    """Tanh u = u within 0.1 %: only the slope at the origin is there to be seen."""
    field = np.repeat([1e3, 2e3, 4e3, 8e3], 4)
    kelvin = np.tile([293.15, 323.15, 353.15, 383.15], 4)
    stress = noisy(Carlson(47e3).stress(field) * Linear(1.5e-3).value(kelvin), 1)
    study = fit_yield_stress(field, kelvin, stress)
    assert any("almost straight: its saturation is extrapolated" in note for note in study.notes)
    assert study.best.name == "carlson"


def test_the_sign_of_the_field_does_not_matter():
    stress = Carlson(47e3).stress(FIELDS) * Linear(1.5e-3).value(AT)
    one, other = (fit_yield_stress(field, AT, stress).best for field in (FIELDS, -FIELDS))
    assert (one.field_law, one.factor) == (other.field_law, other.factor)


@pytest.mark.parametrize(
    ("field", "kelvin", "stress", "said"),
    [
        ([5e4, 1e5, 2e5], [293.15] * 3, [1e4, 2e4, 3e4], "one temperature.*the temperature slope"),
        ([5e4, 1e5], [293.15, 333.15], [1e4, 2e4], "2 yield stresses in a field; expected at least 3"),
        ([5e4, 1e5, 2e5], [293.15, 313.15, 333.15], [1e4, -2e4, 3e4], "yield stress is -20000 Pa at 40 degC"),
        ([0.0, 0.0, 0.0], [293.15, 313.15, 333.15], [1.0, 1.0, 1.0], "no temperature within"),
    ],
)
def test_a_yield_stress_table_that_tells_no_law_is_refused(field, kelvin, stress, said):
    with pytest.raises(InputError, match=said):
        fit_yield_stress(np.array(field), np.array(kelvin), np.array(stress))


@pytest.mark.parametrize("from_K", [293.15, 263.15, 323.15])
def test_the_error_of_a_fall_is_that_of_its_derivative(from_K):
    """sqrt(g C g), g by central differences; a number without an error counts as known."""
    numbers, covariance = np.array([900.0, 150.0]), np.array([[900.0, -40.0], [-40.0, 25.0]])

    def fall(given: Any) -> float:
        cold, hot = Vft(*given).value(np.array([from_K, 373.15]))
        return 100.0 * (1.0 - float(hot / cold))

    steps = 1e-3 * np.eye(2)
    slope = np.array([(fall(numbers + step) - fall(numbers - step)) / 2e-3 for step in steps])
    found, error = fall_of(Vft(*numbers), covariance, from_K, 373.15)
    assert found == pytest.approx(fall(numbers))
    assert error == pytest.approx(math.sqrt(slope @ covariance @ slope), rel=1e-6)
    covariance[1] = covariance[:, 1] = math.nan
    assert fall_of(Vft(*numbers), covariance, from_K, 373.15)[1] == pytest.approx(
        30.0 * abs(slope[0]), rel=1e-6
    )


@pytest.mark.parametrize(
    ("fields", "temperatures", "scale"),
    [((5e4, 1e5, 2e5), 2, True), ((1e5, 2e5), 4, False), ((5e4, 1e5, 2e5), None, False)],
)
def test_the_field_scale_is_fitted_from_3_fields_and_6_points_on(fields, temperatures, scale):
    field = np.repeat(fields, temperatures or 2)
    kelvin = np.tile(np.linspace(293.15, 373.15, temperatures or 2), len(fields))
    if temperatures is None:  # one point short
        field, kelvin = field[:-1], kelvin[:-1]
    study = fit_yield_stress(field, kelvin, Carlson(4e4).stress(field) * Linear(1e-3).value(kelvin))
    assert len(study.fits) == 1 + scale
    assert kinds_of(study.notes) == ([] if scale else ["field_scale_kept"])


@pytest.mark.parametrize(("share", "noted"), [(0.5, False), (0.499, True)])
def test_fields_below_half_the_scale_leave_the_saturation_extrapolated(share, noted):
    most = share * FIELD_SCALE_A_m
    field, kelvin = np.array([0.2, 0.6, 1.0]) * most, np.array([293.15, 333.15, 373.15])
    study = fit_yield_stress(field, kelvin, Carlson(4e4).stress(field) * Linear(1e-3).value(kelvin))
    kinds = dict(zip(kinds_of(study.notes), study.notes, strict=True))
    assert kinds.keys() == {"field_scale_kept"} | ({"saturation_extrapolated"} if noted else set())
    if noted:
        assert f"fields reach {most / 1e3:.3g} kA/m" in kinds["saturation_extrapolated"]


@pytest.mark.parametrize("slope", [-0.05, -1e-4, 0.0, 9e-3])
def test_any_slope_of_the_yield_stress_comes_back_and_a_rise_is_noted(slope):
    stress = Carlson(4e4).stress(FIELDS) * Linear(slope).value(AT)
    study = fit_yield_stress(FIELDS, AT, stress)
    assert study.best.factor.temperature_slope == pytest.approx(slope, abs=1e-9)
    if slope:
        assert kinds_of(study.notes) == (["yield_stress_rises"] if slope < 0.0 else [])


@pytest.mark.parametrize("away_K", [-60.0, 80.0])
def test_a_yield_stress_that_all_but_vanishes_is_fitted_with_a_hundredth_left_at_the_end(away_K):
    """A straight line cannot fall so steeply and stay positive."""
    kelvin = 293.15 + np.tile(away_K * np.linspace(0.0, 1.0, 6), 4)
    stress = Carlson(4e4).stress(FIELDS) * np.exp(-9.0 * np.abs((kelvin - 293.15) / away_K) ** 4)
    for fit in fit_yield_stress(FIELDS, kelvin, stress).fits:
        assert float(fit.factor.value(np.array(293.15 + away_K))) == pytest.approx(0.01, abs=1e-6)


@pytest.mark.parametrize("share", [1.0, 0.005, 200.0])
def test_a_yield_stress_that_no_field_saturates_tells_no_field_scale(share):
    """Tau = 0.4 H: tanh(H / H_s) of the largest scale that is looked for, a hundred times the fields."""
    fields = share * FIELDS
    study = fit_yield_stress(fields, AT, 0.4 * fields * Linear(1e-3).value(AT))
    free = next(fit for fit in study.fits if fit.name == "carlson-free-scale")
    assert free.limit == "its field scale rests on the end of what the fields of the table can tell"
    assert [math.isnan(each.standard_error) for each in free.parameters] == [False, True, False]
    assert free.field_law.field_scale_A_m == pytest.approx(100.0 * fields.max(), rel=0.02)
    assert free.field_law.saturation_Pa / free.field_law.field_scale_A_m == pytest.approx(0.4, rel=1e-3)
    assert free.factor.temperature_slope == pytest.approx(1e-3, rel=1e-3)
