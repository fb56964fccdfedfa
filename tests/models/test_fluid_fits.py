"""Fits to rheometer tables recover known laws with correct standard errors and reject invalid tables."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.errors import InputError
from mrdamper.models.fluids.carlson import Carlson, FIELD_SCALE_A_m, field_strength
from mrdamper.models.fluids.fits import LawFit, Study, fit_viscosity, fit_yield_stress
from mrdamper.models.temperature import Arrhenius, Linear, Reynolds, Vft
from tests.support.examples import examples

KELVIN = np.linspace(293.15, 403.15, 23)
LAWS = (Arrhenius(1435.5), Reynolds(0.013), Vft(753.0, 165.4))
FIELDS = np.repeat(field_strength([0.1, 0.2, 0.4, 0.6], 0.32), 6)  # The flux density is 0.1 to 0.6 T.
AT = np.tile(np.linspace(293.15, 393.15, 6), 4)
SCALES = [(FIELD_SCALE_A_m, "carlson"), (1.1e5, "carlson-free-scale")]


def named(study: Study, name: str) -> LawFit:
    return next(fit for fit in study.fits if fit.name == name)


def noisy(values, seed, share=0.02):
    return values * np.exp(share * np.random.default_rng(seed).standard_normal(np.shape(values)))


@pytest.mark.parametrize("law", LAWS)
def test_viscosity_law_is_recovered_without_noise(law):
    study = fit_viscosity(KELVIN, 0.15 * law.value(KELVIN))
    fit = named(study, law.kind)
    assert fit.at_reference == pytest.approx(0.15, rel=1e-9)
    assert fit.factor.parameters == pytest.approx(law.parameters, rel=1e-6)
    assert fit.rms_percent < 1e-6
    assert fit.fall_percent == pytest.approx(100.0 * (1.0 - float(law.value(373.15))))
    assert study.best.name == law.kind
    assert study.notes == ()


@pytest.mark.parametrize("law", LAWS)
def test_standard_errors_of_viscosity_are_calibrated(law):
    """In 20 tables with 2 % noise, the deviations from the true values match the standard errors."""
    scores, chosen = [], []
    for seed in range(20):
        study = fit_viscosity(KELVIN, noisy(0.15 * law.value(KELVIN), seed))
        chosen.append(study.best.name)
        fit = named(study, law.kind)
        truth = (0.15, *law.parameters)
        scores += [(n.value - t) / n.standard_error for n, t in zip(fit.parameters, truth, strict=True)]
        fall = 100.0 * (1.0 - float(law.value(373.15)))
        scores.append((fit.fall_percent - fall) / fit.fall_standard_error_percent)
    assert np.mean(np.abs(scores) > 3.0) <= 0.03
    assert 0.7 < np.sqrt(np.mean(np.square(scores))) < 1.4
    assert chosen.count(law.kind) >= 15


def test_arrhenius_fit_equals_straight_line_fit():
    """The reference is numpy.polyfit of ln(eta) versus 1/T, with the covariance of this fit."""
    viscosity = noisy(0.15 * Arrhenius(1435.5).value(KELVIN), 1)
    (slope, _), covariance = np.polyfit(1.0 / KELVIN - 1.0 / 293.15, np.log(viscosity), 1, cov=True)
    activation = named(fit_viscosity(KELVIN, viscosity), "arrhenius").parameters[1]
    assert activation.value == pytest.approx(slope, rel=1e-6)
    assert activation.standard_error == pytest.approx(math.sqrt(covariance[0, 0]), rel=1e-4)


@pytest.mark.system
@examples(5)
@given(
    scale=st.floats(1e-3, 1e3),
    order=st.permutations(range(8)),
    rate=st.floats(0.002, 0.03),
    seed=st.integers(0, 99),
)
def test_viscosity_fit_is_independent_of_unit_and_order(scale, order, rate, seed):
    kelvin = np.linspace(300.0, 390.0, 8)
    viscosity = noisy(0.1 * Reynolds(rate).value(kelvin), seed)
    one = fit_viscosity(kelvin, viscosity)
    other = fit_viscosity(kelvin[order], scale * viscosity[order])
    for kind in ("arrhenius", "reynolds"):
        a, b = named(one, kind), named(other, kind)
        assert b.at_reference == pytest.approx(scale * a.at_reference, rel=1e-5)
        assert b.factor.parameters == pytest.approx(a.factor.parameters, rel=1e-5)


def test_viscosity_above_130_degC_is_not_fitted():
    """The viscosity of the paper's fluid collapses above 130 degC."""
    kelvin = 273.15 + np.arange(20.0, 151.0, 5.0)
    collapsing = 0.153 * Arrhenius(1435.5).value(kelvin) / (1.0 + np.exp((kelvin - 414.15) / 1.5))
    study = fit_viscosity(kelvin, collapsing, place="table.csv")
    assert named(study, "arrhenius").factor.parameters[0] == pytest.approx(1435.5, rel=1e-3)
    assert study.used.sum() == np.sum(kelvin <= 403.15 + 1e-9)
    assert any("4 point(s) outside -40 to 130 degC" in note for note in study.notes)


def test_extrapolated_and_rising_viscosity_are_reported():
    kelvin = np.linspace(303.15, 353.15, 5)
    notes = " ".join(fit_viscosity(kelvin, Reynolds(-0.001).value(kelvin)).notes)
    assert "points are at 30 to 80 degC; the fall from 20 to 100 degC is extrapolated" in notes
    assert "the viscosity rises with temperature" in notes
    assert "the VFT law is not fitted" in notes


def test_vft_pole_at_bound_has_no_standard_error():
    """If ln(eta) is concave in T, the fitted pole is at its bound, where VFT equals Reynolds' law."""
    x = KELVIN - 293.15
    study = fit_viscosity(KELVIN, noisy(0.2 * np.exp(-0.005 * x - 6e-5 * x**2), 2, 0.002))
    assert math.isnan(named(study, "vft").parameters[2].standard_error)
    assert study.best.name == "reynolds"


@pytest.mark.parametrize(
    ("kelvin", "viscosity", "said"),
    [
        ([293.15] * 4, [0.1] * 4, r"1 temperature\(s\) within -40 to 130 degC; expected at least 3"),
        ([293.15, 333.15], [0.1, 0.05], r"2 temperature\(s\)"),
        ([293.15, 295.0, 297.0], [0.1, 0.09, 0.08], "over 10 K or more"),
        ([420.0, 430.0, 440.0], [0.1, 0.05, 0.04], r"0 temperature\(s\)"),
        ([293.15, 313.15, 333.15], [0.1, -0.05, 0.04], r"the value at 40 degC is -0\.05"),
        ([293.15, 313.15, 333.15], [0.1, math.inf, 0.04], "the value at 40 degC is inf"),
    ],
)
def test_invalid_viscosity_table_is_rejected(kelvin, viscosity, said):
    with pytest.raises(InputError, match=said):
        fit_viscosity(np.array(kelvin), np.array(viscosity))


@pytest.mark.parametrize(("scale", "name"), SCALES)
def test_yield_stress_law_is_recovered_without_noise(scale, name):
    stress = Carlson(47e3, scale).stress(FIELDS) * Linear(1.67e-3).value(AT)
    best = fit_yield_stress(-FIELDS, AT, stress).best  # The sign of the field has no effect.
    assert best.name == name
    assert best.field_law is not None
    assert best.field_law.saturation_Pa == pytest.approx(47e3, rel=1e-6)
    assert best.field_law.field_scale_A_m == pytest.approx(scale, rel=1e-6)
    assert best.factor.parameters[0] == pytest.approx(1.67e-3, rel=1e-6)
    assert best.fall_percent == pytest.approx(100.0 * 80.0 * 1.67e-3, rel=1e-6)
    np.testing.assert_allclose(best.value(AT, FIELDS), stress, rtol=1e-6)


@pytest.mark.parametrize(("scale", "name"), SCALES)
def test_standard_errors_of_yield_stress_are_calibrated(scale, name):
    scores = []
    clean = Carlson(47e3, scale).stress(FIELDS) * Linear(1.5e-3).value(AT)
    for seed in range(20):
        fit = named(fit_yield_stress(FIELDS, AT, noisy(clean, seed)), name)
        for each, truth in zip(fit.parameters, (47e3, 1.5e-3, scale), strict=False):
            scores.append((each.value - truth) / each.standard_error)
    assert np.mean(np.abs(scores) > 3.0) <= 0.03
    assert 0.7 < np.sqrt(np.mean(np.square(scores))) < 1.4


def test_yield_points_without_field_are_not_fitted():
    field, kelvin = np.append(FIELDS, [0.0, 5e4]), np.append(AT, [293.15, 420.0])
    stress = Carlson(47e3).stress(field) * Linear(1.5e-3).value(kelvin)
    study = fit_yield_stress(field, kelvin, stress, place="tau.csv")
    assert study.used.sum() == FIELDS.size
    assert any("2 point(s) outside -40 to 130 degC or without field" in note for note in study.notes)


def test_saturation_fitted_to_weak_fields_is_reported():
    """In weak fields, tanh u equals u within 0.1 %, so that the data determine only the initial slope."""
    field = np.repeat([1e3, 2e3, 4e3, 8e3], 4)
    kelvin = np.tile([293.15, 323.15, 353.15, 383.15], 4)
    stress = noisy(Carlson(47e3).stress(field) * Linear(1.5e-3).value(kelvin), 1)
    study = fit_yield_stress(field, kelvin, stress)
    assert any("the saturation is extrapolated" in note for note in study.notes)
