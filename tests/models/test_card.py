"""The model card: written and read back, byte for byte, and every kind of damage answered by its place."""

from __future__ import annotations

import contextlib
import json
import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.errors import InputError
from mrdamper.excitation import Sine, drive
from mrdamper.models import card_schema as card_reading
from mrdamper.models.actuation import Actuation
from mrdamper.models.card import Evidence, Excerpt, ModelCard, cut_excerpt, verify_excerpt
from mrdamper.models.card_schema import (
    FORMS,
    SCHEMA_VERSION,
    card_from_json,
    card_sha256,
    card_text,
    card_to_json,
    read_card,
    write_card,
)
from mrdamper.models.card_signature import signed
from mrdamper.models.damper import Damper, OperatingEnvelope
from mrdamper.models.dependence import (
    Bipolynomial,
    Constant,
    Exponential,
    Hill,
    ParameterLaw,
    Polynomial,
    TemperatureDependent,
)
from mrdamper.models.laws import LAWS, Coefficient
from mrdamper.models.python_law import law_from_python
from mrdamper.models.simulate import simulate as simulate_in_kernel
from mrdamper.models.temperature import FACTORS, Arrhenius, Linear, PolynomialFactor, Reynolds, Vft
from tests.oracles.reference import simulate_reference
from tests.support.examples import examples

KEPT = Path(__file__).parent / "card_version_1.json"  # written by the last release of schema version 1

RUNS = (
    {"name": "sine_10mm2Hz_1.00A", "split": "training", "rmse_N": 31.5, "nrmse_percent": 5.4, "command": 1.0},
    {
        "name": "sine_10mm2Hz_0.00A",
        "split": "training",
        "rmse_N": 18.25,
        "nrmse_percent": 15.7,
        "command": 0.0,
    },
    {"name": "sine_5mm3Hz_1.00A", "split": "held_out", "rmse_N": 40.0, "nrmse_percent": 6.0, "motion": ""},
)


def a_damper(**changed):
    forms: dict[str, ParameterLaw] = {
        "viscosity": Polynomial((600.0, 400.0)),
        "yield_force": Hill(90.5, 629.0, 1.14, 1.466, reference=1.5),
        "rho": Exponential(1500.0, -0.3),
        "kappa": Constant(-0.9),
        "n": Constant(1.2),
    }
    return Damper(LAWS["bouc-wen"], {**forms, **changed}, "A", 0.004)


def a_tempered_damper(**changed):
    forms: dict[str, ParameterLaw] = {
        "viscosity": TemperatureDependent(Polynomial((600.0, 400.0)), Arrhenius(1435.5)),
        "stiffness": TemperatureDependent(Constant(900.0), PolynomialFactor((-1e-3, 2e-6)), assumed=True),
        "coulomb_friction": TemperatureDependent(Constant(20.0), Reynolds(0.012)),
        "breakaway_friction": TemperatureDependent(Constant(5.0), Vft(600.0, 150.0)),
        "yield_force": TemperatureDependent(
            Hill(90.5, 629.0, 1.14, 1.466, reference=1.5), Linear(1.2e-3), assumed=True
        ),
        "offset": Bipolynomial((40.0, -0.1, 5.0, 0.02), 1),
        "rho": Exponential(1500.0, -0.3),
        "kappa": Constant(-0.9),
        "n": Constant(1.2),
    }
    actuation = Actuation(0.012, 0.02, 0.003, 0.001, resistance_20_ohm=1.1, largest_command=2.0)
    return Damper(
        LAWS["bouc-wen"], {**forms, **changed}, actuation=actuation, temperature_range=(288.15, 398.15)
    )


def simulate(damper, trajectory):
    return simulate_reference(damper, trajectory, tolerance=1e-8)


def an_excerpt(damper):
    path = drive(Sine(0.005, 3.0), duration=0.4, rate_Hz=200.0, command=1.0)
    if damper.temperature_dependent:
        path = replace(path, temperature=np.full(len(path), 325.0))
    noise = np.random.default_rng(0).normal(0.0, 20.0, len(path))
    measured = simulate(damper, path) + noise
    return cut_excerpt(
        damper, path, measured, simulate, run="sine_10mm2Hz_1.00A", samples=slice(10, 70), scored_from=20
    )


def a_card(damper=None, **changed):
    damper = a_damper() if damper is None else damper
    fields = {
        "title": "Damper on the small rig",
        "damper": damper,
        "envelope": OperatingEnvelope((0.0, 1.0), (-0.025, 0.025), (-0.2, 0.2)),
        "evidence": Evidence(
            runs=RUNS,
            method="varpro",
            cost=43.25,
            converged=False,
            dataset_fingerprint="sha256:0123",
            seed=0,
            versions={"mrdamper": "0.1.0", "numpy": "2.4.6"},
        ),
        "standard_errors": {"yield_force.gain": 3.5, "rho.rate": 0.02, "command_lag_s": 1e-4},
        "preparation": {"cutoff_Hz": 30.0, "dead_band_m": None, "reference": "start"},
        "excerpt": an_excerpt(damper),
        "sources": ("doi:10.0000/none",),
        "notes": {"operator": "Zoë", "list": [1, 2.5, None, True, {"deep": []}]},
    }
    return ModelCard(**{**fields, **changed})


CARD = a_card()
DOCUMENT = json.loads(json.dumps(card_to_json(CARD), default=dict))
WARM = a_card(
    a_tempered_damper(),
    envelope=OperatingEnvelope((0.0, 1.0), (-0.025, 0.025), (-0.2, 0.2), (293.15, 393.15)),
    standard_errors={"viscosity.activation_K": 60.0, "offset.c11": 0.001},
)
WARM_DOCUMENT = json.loads(json.dumps(card_to_json(WARM), default=dict))


def document(*path, value, of=DOCUMENT):
    """Return a copy of a sound document with one place changed; ``value=...`` removes it."""
    changed = json.loads(json.dumps(of))
    inside = changed
    for key in path[:-1]:
        inside = inside[key]
    if value is ...:
        del inside[path[-1]]
    else:
        inside[path[-1]] = value
    return changed


COEFFICIENTS, EVIDENCE = "coefficients", "evidence"


# ------------------------------------------------------------------------------------ there and back


@pytest.mark.parametrize("card", [CARD, WARM], ids=["command alone", "tempered"])
def test_a_card_written_and_read_is_the_same_card_and_the_same_bytes(card, tmp_path):
    first, second = tmp_path / "card.json", tmp_path / "again.json"
    write_card(card, first)
    assert read_card(first) == card
    write_card(read_card(first), second)
    assert first.read_bytes() == second.read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["again.json", "card.json"]


positive = st.floats(1e-3, 1e6)
forms = {
    "yield_force": st.one_of(
        st.builds(Constant, positive),
        st.builds(Hill, positive, positive, st.floats(0.05, 20.0), st.floats(0.2, 8.0)),
        st.builds(Exponential, positive, st.floats(-3.0, 3.0)),
        st.lists(positive, min_size=1, max_size=4).map(lambda parameters: Polynomial(tuple(parameters))),
        st.lists(positive, min_size=1, max_size=3).map(
            lambda parameters: Bipolynomial(tuple(x for c in parameters for x in (c, -1e-3 * c, 2e-6 * c)), 2)
        ),
    ),
    "viscosity": st.builds(
        TemperatureDependent,
        st.one_of(st.builds(Constant, positive), st.builds(Exponential, positive, st.floats(-3.0, 3.0))),
        st.one_of(
            st.builds(Linear, st.floats(-0.005, 0.005)),
            st.builds(Arrhenius, st.floats(-1000.0, 4000.0)),
            st.builds(Reynolds, st.floats(-0.01, 0.05)),
            st.builds(Vft, st.floats(100.0, 2000.0), st.floats(20.0, 250.0)),
            st.lists(st.floats(-1e-7, 1e-7), min_size=1, max_size=3).map(
                lambda parameters: PolynomialFactor(tuple(parameters))
            ),
        ),
        st.booleans(),
    ),
    "rho": st.builds(Constant, st.floats(1.0, 1e6)),
    "kappa": st.builds(Constant, st.floats(-1.0, 1.0)),
    "n": st.builds(Constant, st.floats(0.2, 20.0)),
}
texts = st.text(st.characters(codec="utf-8"), max_size=20)
json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | texts,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(texts, inner, max_size=3),
    max_leaves=8,
)


@pytest.mark.system
@examples(10)
@given(
    forms=st.fixed_dictionaries(forms),
    lag=st.floats(0.0, 1.0),
    unit=st.sampled_from(["A", "V"]),
    title=texts,
    notes=st.dictionaries(texts, json_values, max_size=4),
    error=st.floats(0.0, 1e300),
    temperature=st.none() | st.just((273.15, 393.15)),
    beyond=st.none() | st.tuples(st.floats(200.0, 273.0), st.floats(393.0, 500.0)),
    actuation=st.none() | st.builds(Actuation, *[st.floats(0.0, 1.0)] * 4, st.none() | positive),
)
def test_any_card_comes_back_as_it_went(
    forms, lag, unit, title, notes, error, temperature, beyond, actuation
):
    damper = Damper(LAWS["bouc-wen"], forms, unit, 0.0 if actuation else lag, actuation, beyond)
    envelope = OperatingEnvelope((0.0, 2.0), (-0.02, 0.03), (-1.0, 1.0), temperature)
    card = a_card(
        damper, title=title, notes=notes, envelope=envelope, standard_errors={"n.value": error}, excerpt=None
    )
    text = card_text(card)
    back = card_from_json(json.loads(text))
    assert back == card
    assert card_text(back) == text


def test_the_order_in_which_free_blocks_were_filled_does_not_change_the_bytes():
    one = a_card(notes={"a": 1, "b": {"x": 1, "y": 2}}, excerpt=None)
    other = a_card(notes={"b": {"y": 2, "x": 1}, "a": 1}, excerpt=None)
    assert card_text(one) == card_text(other)


def test_a_file_has_a_line_for_each_entry_of_two_levels_and_short_tables_below_on_one():
    """At most 110 characters with its indent is short; letters of all languages stand as they are."""

    def notes(text):
        return card_text(a_card(notes={"a": {"long": [{"x": text}], "n": {"y": [1, 2]}}}, excerpt=None))

    kept, broken = notes("ë" * 93), notes("ë" * 94)
    end = '      "n": {"y": [1, 2]}\n    }\n  },\n'
    assert f'  "notes": {{\n    "a": {{\n      "long": [{{"x": "{"ë" * 93}"}}],\n{end}' in kept
    entry = f'          "x": "{"ë" * 94}"'
    assert f'      "long": [\n        {{\n{entry}\n        }}\n      ],\n{end}' in broken
    assert '    "runs": [\n      {\n        "name": "sine_10mm2Hz_1.00A",\n' in kept


def test_every_number_stands_beside_its_unit_and_standard_error():
    assert DOCUMENT["coefficients"]["yield_force"]["numbers"]["half_command"] == {
        "value": 1.14,
        "unit": "A",
        "standard_error": None,
    }
    assert DOCUMENT["coefficients"]["viscosity"]["numbers"]["c1"]["unit"] == "N s/m/A"
    assert DOCUMENT["command_lag_standard_error_s"] == 1e-4
    assert DOCUMENT["evidence"]["training"] == {
        "runs": 2,
        "median_nrmse_percent": pytest.approx(10.55),
        "worst_nrmse_percent": 15.7,
    }
    assert DOCUMENT["evidence"]["held_out"]["median_nrmse_percent"] == 6.0


def test_a_tempered_coefficient_says_its_factor_and_who_vouches_for_it():
    viscosity = WARM_DOCUMENT["coefficients"]["viscosity"]
    assert viscosity["temperature"] == {"kind": "arrhenius", "assumed": False}
    assert viscosity["numbers"]["activation_K"] == {"value": 1435.5, "unit": "K", "standard_error": 60.0}
    assert WARM_DOCUMENT["coefficients"]["yield_force"]["temperature"] == {"kind": "linear", "assumed": True}
    assert WARM_DOCUMENT["coefficients"]["stiffness"]["numbers"]["t2"]["unit"] == "1/K^2"
    assert WARM_DOCUMENT["coefficients"]["offset"]["numbers"]["c11"]["unit"] == "N/A/K"
    assert "temperature" not in WARM_DOCUMENT["coefficients"]["rho"]
    assert WARM_DOCUMENT["temperature_range_K"] == [288.15, 398.15]
    assert WARM_DOCUMENT["excerpt"]["temperature_K"] == 325.0


def test_a_temperature_range_of_whole_numbers_gives_the_bytes_of_the_same_range():
    whole = replace(WARM, damper=replace(WARM.damper, temperature_range=(288, 398)))
    text = card_text(whole)
    assert card_text(card_from_json(json.loads(text))) == text


PAGE = (Path(__file__).parents[2] / "docs" / "card.md").read_text(encoding="utf-8")


def test_the_page_of_the_card_names_every_key_kind_and_number():
    assert f"(schema version {SCHEMA_VERSION})" in PAGE
    keys = [*DOCUMENT, *DOCUMENT["evidence"], *WARM_DOCUMENT["actuation"], *DOCUMENT["excerpt"]]
    kinds = [*FORMS, *FACTORS]
    parameters = [n for c in WARM_DOCUMENT["coefficients"].values() for n in c["numbers"]]
    assert [word for word in (*keys, *kinds, *parameters) if f"`{word}`" not in PAGE] == []


def test_the_coefficients_that_the_page_shows_are_read():
    shown = re.findall(r'(?m)^    "\w+": \{\n(?:     .*\n)+    \}', PAGE)
    coefficients = json.loads("{" + ",".join(shown) + "}")
    assert list(coefficients) == ["yield_force", "viscosity"]
    damaged = json.loads(json.dumps(WARM_DOCUMENT))
    damaged["coefficients"] |= coefficients
    damaged["excerpt"] = None  # it is of the other coefficients
    damper = card_from_json(signed(damaged)).damper
    assert damper.parameters["viscosity.activation_K"] == 1435.5
    assert damper.parameters["yield_force.gain"] == 629.0


@pytest.mark.parametrize("card", [CARD, WARM], ids=["command alone", "tempered"])
def test_a_card_is_shown_in_ten_lines_with_its_law_and_errors(card):
    lines = repr(card).splitlines()
    assert len(lines) <= 10
    assert card.title in lines[0]
    assert "bouc-wen" in lines[1]
    assert "0 to 1 A, -25 to 25 mm, up to 200 mm/s" in lines[2]
    assert lines[-2:] == [
        "  training: 2 runs, error 10.55 % median, 15.70 % worst",
        "  held out: 1 runs, error 6.00 % median, 6.00 % worst",
    ]


def test_a_card_cannot_be_changed():
    with pytest.raises(TypeError):
        CARD.notes["operator"] = "someone else"
    with pytest.raises(AttributeError):
        CARD.title = "another"


# -------------------------------------------------------------------------------------- the excerpt


@pytest.mark.parametrize("card", [CARD, WARM], ids=["command alone", "tempered"])
def test_a_card_reproduces_its_own_error_on_its_excerpt(card, tmp_path):
    write_card(card, tmp_path / "card.json")
    found = verify_excerpt(read_card(tmp_path / "card.json"), simulate)
    assert found == card.excerpt.rmse_N
    assert found > 10.0  # the noise that was added, and the start from rest


def test_the_excerpt_is_simulated_at_its_own_temperature():
    """At another one the force is another: the stated error cannot be met."""
    elsewhere = replace(WARM, excerpt=replace(WARM.excerpt, temperature_K=375.0))
    with pytest.raises(InputError, match="its error on the excerpt"):
        verify_excerpt(elsewhere, simulate)
    nowhere = replace(WARM, excerpt=replace(WARM.excerpt, temperature_K=None))
    with pytest.raises(InputError, match="the run has no temperature channel"):
        verify_excerpt(nowhere, simulate_in_kernel)


def test_an_excerpt_that_warms_up_is_kept_at_its_mean():
    damper = a_tempered_damper()
    path = drive(Sine(0.005, 3.0), duration=0.4, rate_Hz=200.0, command=1.0)
    path = replace(path, temperature=320.0 + 10.0 * path.time)
    cut = cut_excerpt(damper, path, np.zeros(len(path)), simulate, run="warming", samples=slice(40, 71))
    assert cut.temperature_K == pytest.approx(320.0 + 10.0 * 55.0 / 200.0, abs=1e-6)
    assert (len(cut.force_N), cut.scored_from) == (31, 0)
    assert cut.rmse_N == pytest.approx(cut.error(damper, simulate), rel=1e-12)


def test_an_excerpt_without_any_force_must_be_met_to_the_bit():
    """A share of the peak force is allowed, which is nothing here."""
    still = dict.fromkeys(("displacement_m", "velocity_m_s", "acceleration_m_s2", "force_N"), (0.0,) * 60)
    excerpt = replace(CARD.excerpt, **still)
    stated = replace(excerpt, rmse_N=excerpt.error(CARD.damper, simulate))
    assert verify_excerpt(replace(CARD, excerpt=stated), simulate) == stated.rmse_N
    with pytest.raises(InputError, match="its error on the excerpt"):
        verify_excerpt(replace(CARD, excerpt=replace(stated, rmse_N=stated.rmse_N + 1e-9)), simulate)


def test_the_error_on_the_excerpt_is_counted_from_where_scoring_starts():
    excerpt = CARD.excerpt
    residual = (simulate(CARD.damper, excerpt.trajectory()) - np.array(excerpt.force_N))[20:]
    assert excerpt.rmse_N == pytest.approx(float(np.sqrt(np.mean(residual**2))), rel=1e-12)


def test_a_card_whose_numbers_were_changed_does_not():
    stiffer = replace(CARD, damper=CARD.damper.with_parameters({"yield_force.gain": 600.0}))
    with pytest.raises(
        InputError, match=r"error on the excerpt of sine_10mm2Hz_1\.00A is .* numbers were changed"
    ):
        verify_excerpt(stiffer, simulate)


@pytest.mark.parametrize(
    "place",
    [
        (COEFFICIENTS, "yield_force", "numbers", "gain", "value"),
        (COEFFICIENTS, "rho", "numbers", "rate", "standard_error"),
        ("envelope", "command", 1),
        ("evidence", "cost"),
        ("excerpt", "force_N", 7),
        ("command_lag_s",),
    ],
)
def test_one_number_changed_by_hand_is_refused(place):
    changed = json.loads(json.dumps(DOCUMENT))
    inside = changed
    for key in place[:-1]:
        inside = inside[key]
    inside[place[-1]] *= 1.0 + 1e-9
    with pytest.raises(InputError, match=r"content's hash is .* edited, cut or put together"):
        card_from_json(changed)


def test_a_doubled_gain_that_was_signed_again_fails_on_the_excerpt():
    changed = document(COEFFICIENTS, "yield_force", "numbers", "gain", "value", value=1258.0)
    with pytest.raises(InputError, match="its error on the excerpt"):
        card_from_json(signed(changed))
    old = json.loads(KEPT.read_text(encoding="utf-8"))
    numbers = old[COEFFICIENTS]["yield_force"]["numbers"]
    numbers[next(iter(numbers))]["value"] *= 2.0
    with pytest.raises(InputError, match="its error on the excerpt"):
        card_from_json(old)


def test_an_excerpt_of_another_card_is_refused():
    other = a_card(a_damper(viscosity=Polynomial((900.0, 400.0))))
    swapped = document("excerpt", value=card_to_json(other)["excerpt"])
    with pytest.raises(InputError, match="content's hash"):
        card_from_json(swapped)


def test_notes_layout_and_the_spelling_of_a_number_stay_outside_the_hash():
    noted = {**DOCUMENT, "notes": {"serial": "A-17"}}
    other_layout = json.dumps(noted, indent=7, sort_keys=True).replace("600.0", "6e2")
    assert card_sha256(card_from_json(json.loads(other_layout))) == DOCUMENT["content_sha256"]


@pytest.mark.parametrize(
    ("place", "value"),
    [
        (("command_lag_s",), 1e6),
        (("envelope", "command"), [0.0, 1e9]),
        (("envelope", "temperature_K"), [1.0, 1e5]),
        (("temperature_range_K",), [200.0, 1e6]),
    ],
)
def test_lags_and_ranges_that_no_damper_has_are_refused(place, value):
    with pytest.raises(InputError, match=f"{'.'.join(place)} is .*expected"):
        card_from_json(signed(document(*place, value=value)))


@pytest.mark.parametrize("key", ["title", "sources", "notes"])
def test_half_a_character_is_refused_when_a_card_is_made(key):
    half = {"title": "a\ud800", "sources": ("a\ud800",), "notes": {"a": "a\ud800"}}[key]
    with pytest.raises(InputError, match=r"character 1 is .*expected Unicode text"):
        a_card(**{key: half})


def test_a_cards_coefficients_stay_on_their_limits_outside_its_runs():
    falling = {**CARD.damper.coefficients, "yield_force": Polynomial((100.0, -80.0))}
    card = a_card(replace(CARD.damper, coefficients=falling), excerpt=None, standard_errors={})
    path = drive(Sine(0.005, 3.0), duration=0.4, rate_Hz=200.0, command=2.0)
    without = replace(card.damper, coefficients={**falling, "yield_force": Constant(0.0)})
    np.testing.assert_array_equal(simulate(card.damper, path), simulate(without, path))
    with pytest.raises(InputError, match=r"yield_force is -0\.8 N"):
        replace(card, envelope=replace(card.envelope, command=(0.0, 2.0)))


def test_a_card_without_excerpt_says_so():
    with pytest.raises(InputError, match="carries no excerpt"):
        verify_excerpt(replace(CARD, excerpt=None), simulate)


# ------------------------------------------------------------------------------------------- damage


@pytest.mark.parametrize(
    ("damaged", "said"),
    [
        (document("titel", value="x"), "unknown key 'titel'; did you mean title?"),
        (document("law", value="bouc-wenn"), "law: there is no law 'bouc-wenn'; did you mean bouc-wen"),
        (
            document("python_law", value="laws.py:Own"),
            "python_law: law 'bouc-wen' is a user's own, and a card",
        ),
        (document("command_unit", value="mA"), "command_unit is 'mA'; expected one of: A, V"),
        (document("command_lag_s", value=-1.0), "command_lag_s is -1.0; expected a number, at least 0"),
        (document(COEFFICIENTS, "rho", value=...), "coefficients: bouc-wen: rho not given"),
        (
            document(COEFFICIENTS, "kapa", value=DOCUMENT[COEFFICIENTS]["kappa"]),
            "coefficients.kapa: bouc-wen has no such coefficient; did you",
        ),
        (
            document(COEFFICIENTS, "rho", "kind", value="exp"),
            "coefficients.rho: there is no parameter law of kind 'exp'; expected one of: constant",
        ),
        (
            document(COEFFICIENTS, "rho", "unit", value="1/mm"),
            "coefficients.rho: unit is '1/mm'; expected '1/m'",
        ),
        (
            document(
                COEFFICIENTS,
                "rho",
                "numbers",
                "rates",
                value={"value": 1, "unit": "1/A", "standard_error": 1},
            ),
            "coefficients.rho: exponential has no parameter 'rates'; did you mean rate?",
        ),
        (
            document(COEFFICIENTS, "rho", "numbers", "rate", value=...),
            "coefficients.rho: exponential: parameter rate is missing; it must be a finite number",
        ),
        (
            document(COEFFICIENTS, "rho", "numbers", "rate", "unit", value="A"),
            "coefficients.rho: numbers.rate.unit is 'A'; expected '1/A'",
        ),
        (
            document(COEFFICIENTS, "rho", "numbers", "rate", "value", value=10**400),
            "coefficients.rho.numbers.rate.value is 10000000000000000000000000000000000000000000000000000000",
        ),
        (
            document(COEFFICIENTS, "rho", "numbers", "rate", "standard_error", value=-1),
            "coefficients.rho.numbers.rate.standard_error is -1; expected a number, at least 0",
        ),
        (
            document(COEFFICIENTS, "yield_force", "settings", value=...),
            "coefficients.yield_force: hill: setting reference is missing",
        ),
        (
            document(COEFFICIENTS, "yield_force", "numbers", "half_command", "value", value=0),
            "coefficients.yield_force: hill: half_command is 0; it must be positive",
        ),
        (
            document(COEFFICIENTS, "yield_force", "numbers", "base", "value", value=-90.5),
            "coefficients: bouc-wen: yield_force is -90.5 N; the law is well posed for 0 to inf N (at 0 A)",
        ),
        (document("envelope", "command", value=[1, 0]), "envelope: command is (1.0, 0.0)"),
        (
            document(EVIDENCE, "runs", 1, "split", value="train"),
            "evidence.runs[1]: name is 'sine_10mm2Hz_0.00A' and split is 'train'; expected a text, and one o",
        ),
        (
            document(EVIDENCE, "runs", 2, "rmse_N", value=...),
            "evidence.runs[2]: no rmse_N; expected name, split, rmse_N, nrmse_percent",
        ),
        (
            document(EVIDENCE, "runs", 0, "nrmse_percent", value=1.0),
            "evidence.training is {'runs': 2, 'median_nrmse_percent': 10.55, 'worst_nrmse_percent': 15.7}; t",
        ),
        (document("excerpt", "force_N", value=[1.0]), "excerpt: lengths are"),
        (
            document("schema_version", value=SCHEMA_VERSION + 1),
            "schema_version is 4, and this mrdamper reads up to 3; upgrade",
        ),
        (
            document("temperature_range_K", value=[400, 300]),
            "temperature_range_K is [400.0, 300.0]; expected low and high within 150 to 600",
        ),
        (
            document("temperature_range_K", value=[0, 300]),
            "temperature_range_K is [0.0, 300.0]; expected low and high within 150 to 600",
        ),
        (
            document("actuation", value=WARM_DOCUMENT["actuation"]),
            "actuation: command_lag_s is 0.004 beside it; expected one of them",
        ),
        (
            document("actuation", "fall_s", value=-1, of=WARM_DOCUMENT),
            "actuation: fall_s is -1.0; expected a finite number, 0 or more",
        ),
        (
            document(COEFFICIENTS, "viscosity", "temperature", "kind", value="arhenius", of=WARM_DOCUMENT),
            "coefficients.viscosity: there is no temperature factor of kind 'arhenius'; did you mean "
            "arrhenius?",
        ),
        (
            document(COEFFICIENTS, "viscosity", "temperature", "kind", value="reynolds", of=WARM_DOCUMENT),
            "coefficients.viscosity: reynolds: parameter temperature_rate is missing; it must be a finite nu",
        ),
        (
            document(COEFFICIENTS, "viscosity", "temperature", value=..., of=WARM_DOCUMENT),
            "coefficients.viscosity: polynomial has no parameter 'activation_K'; expected one of: c0, c1, c2",
        ),
        (
            document(COEFFICIENTS, "offset", "temperature", value={"kind": "linear"}, of=WARM_DOCUMENT),
            "coefficients.offset: linear: parameter temperature_slope is missing; it must be a finite number",
        ),
        (
            document(COEFFICIENTS, "stiffness", "numbers", "t1", value=..., of=WARM_DOCUMENT),
            "coefficients.stiffness: polynomial: parameter t1 is missing; it must be a finite number",
        ),
        (
            document(
                COEFFICIENTS, "viscosity", "numbers", "activation_K", "unit", value="1/K", of=WARM_DOCUMENT
            ),
            "coefficients.viscosity: numbers.activation_K.unit is '1/K'; expected 'K'",
        ),
        (
            document(
                COEFFICIENTS,
                "breakaway_friction",
                "numbers",
                "vft_pole_K",
                "value",
                value=400,
                of=WARM_DOCUMENT,
            ),
            "coefficients.breakaway_friction: temperature factor: vft_pole_K is 400 K; it must be below",
        ),
        (
            document(
                COEFFICIENTS,
                "yield_force",
                "numbers",
                "temperature_slope",
                "value",
                value=0.02,
                of=WARM_DOCUMENT,
            ),
            "coefficients: bouc-wen: yield_force is -22.625 N; the law is well posed for 0 to inf N (at 0 A, "
            "82.5 degC)",
        ),
        (
            document(COEFFICIENTS, "offset", "settings", "temperature_degree", value=1e300, of=WARM_DOCUMENT),
            "coefficients.offset: bipolynomial: temperature_degree is 1e+300; it must be a whole number",
        ),
        (document("schema_version", value=0), "schema_version is 0, which no longer can be read"),
        (document("schema_version", value="1"), "schema_version is '1'; a model card has an integer there"),
        ([1, 2], "a card is a table {...} with schema_version; found list"),
    ],
)
def test_each_kind_of_damage_is_one_problem_named_by_its_place(damaged, said, tmp_path):
    path = tmp_path / "card.json"
    path.write_text(json.dumps(damaged), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_card(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert said in message.removeprefix(f"{path}: ")
    assert "problems" not in message
    assert len(message.splitlines()) == 1


def test_all_problems_are_reported_at_once():
    """First those of the records, then those of what they say together."""
    damaged = document("titel", value="x")
    damaged["coefficients"]["rho"]["numbers"]["rate"]["value"] = None
    damaged["evidence"]["cost"] = "low"
    del damaged["envelope"]["command"]
    with pytest.raises(InputError) as caught:
        card_from_json(damaged, "card.json")
    assert sorted(line.removeprefix("card.json: ") for line in str(caught.value).splitlines()) == [
        "coefficients.rho.numbers.rate.value is None; expected a number",
        "envelope.command is missing; expected a list of 2, each a number",
        "evidence.cost is 'low'; expected a number",
        "unknown key 'titel'; did you mean title?",
    ]
    damaged = document("coefficients", "yield_force", "kind", value="hil")
    damaged["coefficients"]["rho"]["unit"] = "mm"
    damaged["evidence"]["held_out"]["runs"] = 7
    with pytest.raises(InputError) as caught:
        card_from_json(damaged)
    assert [line.split(" ")[1] for line in str(caught.value).splitlines()] == [
        "coefficients.yield_force:",
        "coefficients.rho:",
        "evidence.held_out",
    ]


@pytest.mark.parametrize("key", sorted(DOCUMENT))
def test_each_missing_key_is_one_problem_and_is_named(key):
    with pytest.raises(InputError) as caught:
        card_from_json(document(key, value=...))
    assert str(caught.value).startswith(
        "card: schema_version is None" if key == "schema_version" else f"card: {key} is missing"
    )
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.system
@examples(50)
@given(st.data(), st.sampled_from([DOCUMENT, WARM_DOCUMENT]))
def test_a_card_with_any_value_replaced_is_read_or_refused_never_a_crash(data, sound):
    """Whatever stands in the file, the answer is a card or an ``InputError``."""
    changed = json.loads(json.dumps(sound))
    inside = changed
    while True:
        keys = list(inside) if isinstance(inside, dict) else list(range(len(inside)))
        key = data.draw(st.sampled_from(keys))
        if isinstance(inside[key], dict | list) and inside[key] and data.draw(st.booleans()):
            inside = inside[key]
            continue
        inside[key] = data.draw(json_values)
        break
    with contextlib.suppress(InputError):
        assert isinstance(card_from_json(changed), ModelCard)


@pytest.mark.parametrize("share", [0.0, 0.2, 0.5, 0.9, 0.999])
def test_a_file_that_was_cut_off_is_reported_with_its_line(share, tmp_path):
    path = tmp_path / "card.json"
    write_card(CARD, path)
    text = path.read_text(encoding="utf-8")
    path.write_text(text[: int(share * (len(text) - 2))], encoding="utf-8")
    with pytest.raises(InputError, match=r"card\.json: line \d+, column \d+: .*cut off while copying"):
        read_card(path)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"\xff\xfe{", "not UTF-8 text at byte 0"),
        (b'{"schema_version": 1, "title": NaN}', "NaN is not a JSON number"),
        (b'{"schema_version": 1, "title": "a", "title": "b"}', "the key 'title' stands twice"),
        (b"[" * 100_000, "not a card: "),
        (b"null", "a card is a table"),
    ],
)
def test_what_is_no_card_at_all_is_refused(content, said, tmp_path):
    path = tmp_path / "card.json"
    path.write_bytes(content)
    with pytest.raises(InputError, match=said):
        read_card(path)


def test_a_missing_file_and_a_folder_that_is_not_there_are_bad_input(tmp_path):
    with pytest.raises(InputError, match=r"gone\.json: cannot read the card: No such file"):
        read_card(tmp_path / "gone.json")
    with pytest.raises(InputError, match="cannot write: No such file or directory; choose another folder"):
        write_card(CARD, tmp_path / "nowhere" / "card.json")


def test_a_write_that_fails_leaves_the_old_card_and_nothing_else(tmp_path, monkeypatch):
    path = tmp_path / "card.json"
    write_card(CARD, path)
    before = path.read_bytes()

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(InputError, match="No space left"):
        write_card(a_card(title="another"), path)
    assert [each.name for each in tmp_path.iterdir()] == ["card.json"]
    assert path.read_bytes() == before


# ----------------------------------------------------------------------------- older and own


def test_a_card_of_schema_version_1_gives_the_forces_that_it_gave():
    """The file was written by that version, from its own fit, and keeps its forces on the excerpt."""
    card = read_card(KEPT)
    assert card.excerpt is not None
    assert json.loads(KEPT.read_text(encoding="utf-8"))["schema_version"] == 1
    gave = np.array(card.notes["force_of_this_card_on_its_excerpt_N"])
    found = simulate_in_kernel(card.damper, card.excerpt.trajectory())
    np.testing.assert_allclose(found, gave, rtol=0.0, atol=1e-9 * np.abs(gave).max())
    assert verify_excerpt(card, simulate_in_kernel) == pytest.approx(card.excerpt.rmse_N, rel=1e-9)
    assert not card.damper.temperature_dependent
    assert card.damper.actuation is None
    assert card.damper.command_lag_s == 0.0125


def test_an_upgraded_card_is_written_in_the_present_version_and_is_the_same_card(tmp_path):
    card = read_card(KEPT)
    write_card(card, tmp_path / "card.json")
    assert (
        json.loads((tmp_path / "card.json").read_text(encoding="utf-8"))["schema_version"] == SCHEMA_VERSION
    )
    assert read_card(tmp_path / "card.json") == card
    assert card.upgraded_from == 1
    assert "upgraded from schema version 1, which carried no hash" in repr(card)


def test_a_damaged_card_of_an_older_version_is_refused_by_place():
    old = json.loads(KEPT.read_text(encoding="utf-8"))
    with pytest.raises(InputError, match=r"^card: excerpt is 'none'; expected a table"):
        card_from_json({**old, "excerpt": "none"})
    with pytest.raises(InputError, match=r"^card: coefficients\.rho: unit is '1/mm'"):
        card_from_json(document("coefficients", "rho", "unit", value="1/mm", of=old))


def test_an_older_card_is_upgraded_one_step_at_a_time(monkeypatch):
    """The mechanism: two schemas after the present one are made up here."""
    monkeypatch.setattr(card_reading, "SCHEMA_VERSION", SCHEMA_VERSION + 2)
    monkeypatch.setitem(card_reading.UPGRADES, SCHEMA_VERSION, lambda d: {**d, "heading": d["title"] + "!"})
    monkeypatch.setitem(card_reading.UPGRADES, SCHEMA_VERSION + 1, _rename_heading)
    assert card_from_json(DOCUMENT) == replace(CARD, title=CARD.title + "!")


def _rename_heading(old):
    kept = {key: value for key, value in old.items() if key != "heading"}
    return {**kept, "title": old["heading"]}


class Dashpot:
    """A user's dashpot."""

    name = "dashpot"
    coefficients = (Coefficient("c", "N s/m", "damping", linear=True),)

    def rate(self, state, displacement, velocity, values):
        return 0.0

    def force(self, state, displacement, velocity, values):
        return values["c"] * velocity


def test_a_card_of_a_users_law_names_its_file_and_needs_the_law_passed(tmp_path):
    law = law_from_python(Dashpot())
    path = tmp_path / "card.json"
    own = a_card(Damper(law, {"c": Constant(200.0)}), python_law="laws.py:Dashpot", standard_errors={})
    write_card(own, path)
    assert read_card(path, python_law=law) == own
    with pytest.raises(InputError, match=r"pass python_law=load_python_law\('laws.py:Dashpot'\)"):
        read_card(path)

    class Other(Dashpot):
        name = "other"

    with pytest.raises(InputError, match="the card needs the law 'dashpot'; the one passed is 'other'"):
        read_card(path, python_law=law_from_python(Other()))


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (
            lambda: a_card(standard_errors={"rho.rat": 1.0}),
            "standard_errors: no parameter 'rho.rat'; did you mean",
        ),
        (lambda: a_card(python_law="laws.py:Own"), "law 'bouc-wen' and python_law 'laws.py:Own' disagree"),
        (lambda: a_card(notes={"x": float("nan")}), "notes.x is nan; expected what JSON holds"),
        (lambda: a_card(notes={"x": [object()]}), r"notes.x\[0\] is <object"),
        (lambda: a_card(notes={1: "x"}), r"notes: keys are \[1\]; expected text"),
        (
            lambda: a_card(
                a_damper(yield_force=Polynomial((100.0, -200.0))), excerpt=None, standard_errors={}
            ),
            "yield_force is -1 N",
        ),
        (
            lambda: Evidence(runs=({"name": "x"},), method="", cost=0.0, dataset_fingerprint=""),
            r"evidence.runs\[0\]: no split, rmse_N, nrmse_percent",
        ),
        (
            lambda: Evidence(
                runs=({**RUNS[0], "split": "test"},), method="", cost=0.0, dataset_fingerprint=""
            ),
            r"evidence.runs\[0\]: name is 'sine_10mm2Hz_1.00A' and split is 'test'",
        ),
        (lambda: replace(CARD.excerpt, scored_from=60), "scored_from is 60"),
    ],
)
def test_a_card_that_could_not_be_read_back_cannot_be_made(make, said):
    with pytest.raises(InputError, match=said):
        make()


def test_numbers_from_numpy_are_taken_as_numbers():
    card = a_card(notes={"x": np.float64(1.5), "y": np.arange(3), "z": np.bool_(1)}, excerpt=None)
    assert dict(card.notes) == {"x": 1.5, "y": (0, 1, 2), "z": True}
    assert isinstance(CARD.excerpt, Excerpt)
