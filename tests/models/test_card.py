"""Model cards are written and read without change, and edited or invalid cards are rejected."""

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
from mrdamper.models.actuation import Actuation
from mrdamper.models.card import Evidence, ModelCard
from mrdamper.models.card_schema import (
    FORMS,
    SCHEMA_VERSION,
    card_from_json,
    card_sha256,
    card_text,
    card_to_json,
    read_card,
    signed,
    write_card,
)
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
from mrdamper.models.simulate import simulate
from mrdamper.models.temperature import FACTORS, Arrhenius, Linear, PolynomialFactor, Reynolds, Vft
from tests.support.examples import examples

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


def a_temperature_dependent_damper(**changed):
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
        "sources": ("doi:10.0000/none",),
        "notes": {"operator": "Zoë", "list": [1, 2.5, None, True, {"deep": []}]},
    }
    return ModelCard(**{**fields, **changed})


CARD = a_card()
DOCUMENT = json.loads(json.dumps(card_to_json(CARD), default=dict))
WARM = a_card(
    a_temperature_dependent_damper(),
    envelope=OperatingEnvelope((0.0, 1.0), (-0.025, 0.025), (-0.2, 0.2), (293.15, 393.15)),
    standard_errors={"viscosity.activation_K": 60.0, "offset.c11": 0.001},
)
WARM_DOCUMENT = json.loads(json.dumps(card_to_json(WARM), default=dict))


def document(*path, value, of=DOCUMENT):
    """Return the JSON of a card with one changed value and a valid hash; ``value=...`` removes the value."""
    changed = json.loads(json.dumps(of))
    inside = changed
    for key in path[:-1]:
        inside = inside[key]
    if value is ...:
        del inside[path[-1]]
    else:
        inside[path[-1]] = value
    return signed(changed)


COEFFICIENTS = "coefficients"


@pytest.mark.parametrize("card", [CARD, WARM], ids=["current alone", "temperature dependent"])
def test_written_card_is_read_unchanged(card, tmp_path):
    """The read card equals the written card, and writing it again gives the same bytes."""
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
@examples(4)
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
def test_any_card_survives_round_trip(forms, lag, unit, title, notes, error, temperature, beyond, actuation):
    damper = Damper(LAWS["bouc-wen"], forms, unit, 0.0 if actuation else lag, actuation, beyond)
    envelope = OperatingEnvelope((0.0, 2.0), (-0.02, 0.03), (-1.0, 1.0), temperature)
    card = a_card(damper, title=title, notes=notes, envelope=envelope, standard_errors={"n.value": error})
    text = card_text(card)
    back = card_from_json(json.loads(text))
    assert back == card
    assert card_text(back) == text


def test_equal_cards_have_equal_bytes():
    """Equal cards have equal bytes for any order of notes and any types of numbers."""
    one = a_card(notes={"a": 1, "b": {"x": 1, "y": 2}})
    other = a_card(notes={"b": {"y": 2, "x": 1}, "a": 1})
    assert card_text(one) == card_text(other)
    whole = card_text(replace(WARM, damper=replace(WARM.damper, temperature_range=(288, 398))))
    assert card_text(card_from_json(json.loads(whole))) == whole


def test_card_numbers_have_units_and_standard_errors():
    numbers = DOCUMENT[COEFFICIENTS]["yield_force"]["numbers"]
    assert numbers["half_command"] == {"value": 1.14, "unit": "A", "standard_error": None}
    assert numbers["gain"]["standard_error"] == 3.5
    assert DOCUMENT[COEFFICIENTS]["viscosity"]["numbers"]["c1"]["unit"] == "N s/m/A"
    assert DOCUMENT["evidence"]["training"] == {
        "runs": 2,
        "median_nrmse_percent": pytest.approx(10.55),
        "worst_nrmse_percent": 15.7,
    }
    warm = WARM_DOCUMENT[COEFFICIENTS]
    assert warm["yield_force"]["temperature"] == {"kind": "linear", "assumed": True}
    assert warm["viscosity"]["numbers"]["activation_K"] == {
        "value": 1435.5,
        "unit": "K",
        "standard_error": 60.0,
    }
    assert warm["offset"]["numbers"]["c11"]["unit"] == "N/A/K"


PAGE = (Path(__file__).parents[2] / "docs" / "card.md").read_text(encoding="utf-8")


def test_documentation_contains_every_card_key():
    assert f"(schema version {SCHEMA_VERSION})" in PAGE
    keys = [*DOCUMENT, *DOCUMENT["evidence"], *WARM_DOCUMENT["actuation"]]
    kinds = [*FORMS, *FACTORS]
    parameters = [n for c in WARM_DOCUMENT[COEFFICIENTS].values() for n in c["numbers"]]
    assert [word for word in (*keys, *kinds, *parameters) if f"`{word}`" not in PAGE] == []


def test_coefficients_in_card_documentation_are_valid():
    shown = re.findall(r'(?m)^    "\w+": \{\n(?:     .*\n)+    \}', PAGE)
    coefficients = json.loads("{" + ",".join(shown) + "}")
    assert list(coefficients) == ["yield_force", "viscosity"]
    changed = {**WARM_DOCUMENT, COEFFICIENTS: {**WARM_DOCUMENT[COEFFICIENTS], **coefficients}}
    damper = card_from_json(signed(changed)).damper
    assert damper.parameters["viscosity.activation_K"] == 1435.5
    assert damper.parameters["yield_force.gain"] == 629.0


# Hash of the content


@pytest.mark.parametrize(
    "place",
    [
        (COEFFICIENTS, "yield_force", "numbers", "gain", "value"),
        (COEFFICIENTS, "rho", "numbers", "rate", "standard_error"),
        ("envelope", "command", 1),
        ("evidence", "cost"),
        ("command_lag_s",),
    ],
)
def test_edited_card_is_rejected(place):
    """The hash detects a change in the ninth digit of a single number."""
    changed = json.loads(json.dumps(DOCUMENT))
    inside = changed
    for key in place[:-1]:
        inside = inside[key]
    inside[place[-1]] *= 1.0 + 1e-9
    with pytest.raises(InputError, match=r"content_sha256 is .* edited or damaged.* identify again"):
        card_from_json(changed)


def test_card_hash_ignores_notes_and_layout():
    noted = {**DOCUMENT, "notes": {"serial": "A-17"}}
    other_layout = json.dumps(noted, indent=7, sort_keys=True).replace("600.0", "6e2")
    assert card_sha256(card_from_json(json.loads(other_layout))) == DOCUMENT["content_sha256"]


@pytest.mark.parametrize("version", [1, SCHEMA_VERSION - 1, SCHEMA_VERSION + 1, None, "4"])
def test_unknown_card_schema_is_rejected(version):
    with pytest.raises(InputError, match=rf"schema_version is .*expected {SCHEMA_VERSION}, the only version"):
        card_from_json(document("schema_version", value=version))


# Invalid content with a correct hash


@pytest.mark.parametrize(
    ("damaged", "said"),
    [
        (document("titel", value="x"), "unknown key 'titel'; did you mean title?"),
        (document("title", value=...), "title is missing"),
        (document("law", value="bouc-wenn"), "there is no law 'bouc-wenn'; did you mean bouc-wen"),
        (
            document(COEFFICIENTS, "rho", "numbers", "rate", "value", value=10**400),
            "coefficients.rho.numbers.rate.value is 1000000",
        ),
        (
            document(COEFFICIENTS, "yield_force", "numbers", "base", "value", value=-90.5),
            "bouc-wen: yield_force is -90.5 N; the law is well posed for 0 to inf N (at 0 A)",
        ),
        (
            document("actuation", value=WARM_DOCUMENT["actuation"]),
            "command_lag_s and an actuation are both given",
        ),
        (
            document(COEFFICIENTS, "viscosity", "temperature", "kind", value="arhenius", of=WARM_DOCUMENT),
            "there is no temperature factor of kind 'arhenius'; did you mean arrhenius?",
        ),
    ],
)
def test_invalid_card_is_rejected_with_location(damaged, said, tmp_path):
    path = tmp_path / "card.json"
    path.write_text(json.dumps(damaged), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_card(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert said in str(caught.value)


@pytest.mark.system
@examples(50)
@given(st.data(), st.sampled_from([DOCUMENT, WARM_DOCUMENT]))
def test_card_with_random_value_is_read_or_rejected(data, valid):
    """A card with any value at any location is either read or rejected with ``InputError``."""
    changed = json.loads(json.dumps(valid))
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
        assert isinstance(card_from_json(signed(changed)), ModelCard)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"\xff\xfe{", "not UTF-8 text at byte 0"),
        (b'{"schema_version": 1, "title": NaN}', "NaN is not a JSON number"),
        (b'{"schema_version": 1, "title": "a", "title": "b"}', "the key 'title' is used twice"),
        (b"[" * 100_000, "not a card: "),
    ],
)
def test_file_without_card_is_rejected(content, said, tmp_path):
    path = tmp_path / "card.json"
    path.write_bytes(content)
    with pytest.raises(InputError, match=said):
        read_card(path)


def test_missing_file_or_folder_is_rejected(tmp_path):
    with pytest.raises(InputError, match=r"gone\.json: cannot read the card: No such file"):
        read_card(tmp_path / "gone.json")
    with pytest.raises(InputError, match="cannot write: No such file or directory; choose another folder"):
        write_card(CARD, tmp_path / "nowhere" / "card.json")


def test_failed_write_keeps_old_card(tmp_path, monkeypatch):
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


# Cards created in Python


class Dashpot:
    """A user-defined law: a linear dashpot."""

    name = "dashpot"
    coefficients = (Coefficient("c", "N s/m", "damping", linear=True),)

    def rate(self, state, displacement, velocity, values):
        return 0.0

    def force(self, state, displacement, velocity, values):
        return values["c"] * velocity


def test_reading_card_of_user_law_requires_law(tmp_path):
    """The card contains the path of the file with the law, but no code."""
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


def test_coefficients_are_clipped_outside_envelope():
    """A yield force that would be negative above the largest current of the runs is zero there."""
    falling = {**CARD.damper.coefficients, "yield_force": Polynomial((100.0, -80.0))}
    card = a_card(replace(CARD.damper, coefficients=falling), standard_errors={})
    path = drive(Sine(0.005, 3.0), duration=0.4, rate_Hz=200.0, command=2.0)
    without = replace(card.damper, coefficients={**falling, "yield_force": Constant(0.0)})
    np.testing.assert_array_equal(simulate(card.damper, path), simulate(without, path))
    with pytest.raises(InputError, match=r"yield_force is -0\.8 N"):
        replace(card, envelope=replace(card.envelope, command=(0.0, 2.0)))


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: a_card(standard_errors={"rho.rat": 1.0}), "no parameter 'rho.rat'; did you mean"),
        (lambda: a_card(notes={"x": float("nan")}), "notes.x is nan; expected JSON values"),
        (
            lambda: Evidence(runs=({"name": "x"},), method="", cost=0.0, dataset_fingerprint=""),
            r"evidence.runs\[0\]: no split, rmse_N, nrmse_percent",
        ),
    ],
)
def test_card_that_cannot_be_written_is_rejected(make, said):
    with pytest.raises(InputError, match=said):
        make()


def test_numpy_numbers_in_card_become_python_numbers():
    card = a_card(notes={"x": np.float64(1.5), "y": np.arange(3), "z": np.bool_(1)})
    assert dict(card.notes) == {"x": 1.5, "y": (0, 1, 2), "z": True}
