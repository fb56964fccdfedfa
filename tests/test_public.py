"""The public face: every job is a function, and its result shows itself."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Iterator, Mapping

import pandas as pd
import pytest

import mrdamper
from mrdamper.errors import InputError
from mrdamper.registry import JOBS, public_names
from mrdamper.registry.public import function_of
from mrdamper.virtual_rig.campaign import Campaign
from mrdamper.virtual_rig.measurement import measure
from mrdamper.virtual_rig.plant import find_preset
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
        ({"model": "zone"}, "heat: model is 'zone'; expected one of: reduced, network, elements, lumped"),
        ({"air_m_s": -1.0}, "heat: air_m_s is -1.0; expected a number in m/s, 0 to 200"),
    ],
)
def test_a_wrong_value_is_refused_with_what_is_expected(given, said):
    with pytest.raises(InputError, match=said):
        mrdamper.heat(paper_card(), "paper", **given)


def test_a_misspelt_option_is_a_type_error_that_names_the_nearest():
    with pytest.raises(TypeError, match="no option 'ambiant_degC'; did you mean ambient_degC"):
        mrdamper.heat(paper_card(), "paper", ambiant_degC=3.0)


# ------------------------------------------------------------------------------- as people use it (figures)

FRAMES_TO_LOOPS = """
import mrdamper
fit = mrdamper.fit([low, high], law="bouc-wen")
fit.plot()
"""  # at most 4 lines

LOGGER_TO_CONTROLLER = """
import mrdamper
runs = mrdamper.read("logger.csv", displacement_mm="Pos", force_kN="Load", current_A="Coil")
card = mrdamper.fit(runs, "bouc-wen").card()
proved = card.export(c="controller")
"""  # at most 6 lines


@pytest.fixture(scope="module")
def logged():
    """Return runs at two currents and one whose current steps, as frames."""
    campaign = Campaign(motions=("sine5mm1Hz",), currents_A=(0.5, 2.0), temperatures_degC=(20.0,))
    frames = [
        pd.DataFrame(
            {
                "time_s": run.time,
                "displacement_mm": 1e3 * run.displacement,
                "force_N": run.force,
                "current_A": run.command,
            }
        )
        for run, _ in measure(find_preset("nominal"), campaign)
    ]
    return frames


def test_two_frames_come_to_plotted_loops_with_their_error_in_at_most_four_lines(logged):
    names = {"low": logged[0], "high": logged[1]}
    exec(FRAMES_TO_LOOPS, names)
    assert len(FRAMES_TO_LOOPS.strip().splitlines()) <= 4
    figure = names["fit"].plot()
    assert len(figure.axes) == 4  # two runs, over displacement and over velocity
    titles = [text.get_text() for text in figure.texts]
    for title, error in zip(titles, names["fit"].assessment.runs, strict=True):
        assert f"{error.rmse_N:.0f} N" in title
    assert names["fit"]._repr_html_().count("<svg") == 1


def test_a_raw_logger_file_comes_to_a_compiled_controller_in_at_most_six_lines(logged, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    raw = pd.concat(logged)
    raw["force_N"] /= 1e3
    raw.columns = ["time_s", "Pos", "Load", "Coil"]
    raw.to_csv("logger.csv", index=False)
    names: dict[str, object] = {}
    exec(LOGGER_TO_CONTROLLER, names)
    assert len(LOGGER_TO_CONTROLLER.strip().splitlines()) <= 6
    proved = names["proved"]
    assert proved.code.record.passed  # type: ignore[attr-defined]
    assert any((tmp_path / "controller").glob("*.c"))


def values_in(value: object, depth: int = 5) -> Iterator[object]:
    """Yield a value and those that it holds, some of each collection."""
    if depth and dataclasses.is_dataclass(value) and type(value).__module__.startswith("mrdamper"):
        yield value
        for field in dataclasses.fields(value):
            yield from values_in(getattr(value, field.name), depth - 1)
    elif depth and isinstance(value, tuple | list | Mapping):
        held = list(value.values()) if isinstance(value, Mapping) else list(value)
        for each in held[:2]:
            yield from values_in(each, depth - 1)


def test_no_public_object_prints_more_than_ten_lines(logged):
    """Results of the jobs, and all values that they hold: runs, fits, cards, dampers, networks."""
    runs = mrdamper.read(logged)
    fit = mrdamper.fit(runs, "bouc-wen")
    card = fit.card()
    results = (
        *(runs, fit, card, mrdamper.check(runs), fit.evaluate(runs), card.simulate(runs.runs[0])),
        *(card.heat("paper"), card.cite(), card.compare(card), card.export(what=("table",), verify=False)),
        card.track(targets="sine-900N-1Hz"),
    )
    longest: dict[str, int] = {}
    for each in (each for result in results for each in values_in(result)):
        name, lines = type(each).__name__, len(repr(each).splitlines())
        longest[name] = max(lines, longest.get(name, 0))
    assert len(longest) > 30
    assert {name: lines for name, lines in longest.items() if lines > 10} == {}


def test_a_card_has_a_method_for_each_job_that_begins_with_one():
    begins = {job.name for job in JOBS.values() if job.inputs and job.inputs[0].kind.startswith("card")}
    assert {"evaluate", "simulate", "heat", "heatsink", "track", "export"} <= begins
    for name in (*begins, "plot", "save", "summary"):
        assert callable(getattr(mrdamper.ModelCard, name))


def test_every_job_is_a_name_of_the_package():
    assert {*public_names(), "read"} <= {*mrdamper.__all__}
