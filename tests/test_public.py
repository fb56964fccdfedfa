"""The public face: every job is a function, and its result shows itself."""

from __future__ import annotations

import inspect

import pytest

import mrdamper
from mrdamper.errors import InputError
from mrdamper.registry import JOBS
from mrdamper.registry.public import function_of, public_names
from tests.support.heated import paper_card

pytestmark = pytest.mark.system


@pytest.mark.parametrize("name", sorted(public_names()))
def test_a_jobs_function_has_the_inputs_and_options_that_its_row_declares(name):
    job = public_names()[name]
    known = inspect.signature(function_of(job)).parameters
    assert [*known] == [
        *(each.name for each in sorted(job.inputs, key=lambda each: not each.required)),
        *(field.name for field in (*job.reading, *job.fields)),
        *(each.name for each in job.outputs),
        "on_progress",
    ]
    for field in job.fields:
        assert field.option.help, field.name


@pytest.mark.parametrize("name", sorted(JOBS))
def test_a_command_has_an_option_for_each_field(name):
    from mrdamper.cli.commands import parameters_of

    job = JOBS[name]
    made = {parameter.name for parameter in parameters_of(job)}
    shown = {field.name for field in job.fields if field.option.flag != "-"}
    assert shown | {each.name for each in job.inputs if each.flag != "-"} <= made
    assert {field.name for field in job.reading} <= made


def test_a_result_says_in_few_lines_what_was_asked(tmp_path):
    hot = mrdamper.heat(paper_card(), "paper", ambient_degC=35.0, model="lumped")
    assert hot.rise.fluid_degC[0] == pytest.approx(35.0)
    assert "limit of the fluid, 130 degC" in hot.summary()
    assert len(repr(hot).splitlines()) <= 10
    assert "<svg" in hot._repr_html_()
    assert hot.plot().axes
    assert len(hot.to_frame()) == len(hot.rise.time)
    hot.save(tmp_path / "out")
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"heat.html", "heat.json", "heat.csv"}


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"model": "zone"}, "heat: model is 'zone'; expected one of: zones, lumped"),
        ({"air_m_s": -1.0}, "heat: air_m_s is -1.0; expected a number in m/s, 0 to 200"),
    ],
)
def test_a_wrong_value_is_refused_with_what_is_expected(given, said):
    with pytest.raises(InputError, match=said):
        mrdamper.heat(paper_card(), "paper", **given)


def test_a_misspelt_option_is_a_type_error_that_names_the_nearest():
    with pytest.raises(TypeError, match="no option 'ambiant_degC'; did you mean ambient_degC"):
        mrdamper.heat(paper_card(), "paper", ambiant_degC=3.0)
