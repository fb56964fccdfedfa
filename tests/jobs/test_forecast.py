"""``mrdamper forecast``: what ten minutes of a curve say of the next fifty."""

from __future__ import annotations

import numpy as np
import pytest

import mrdamper
from mrdamper.errors import InputError
from mrdamper.jobs.options import ForecastOptions
from mrdamper.registry import JOBS

MINUTES = 10.0


def truth(time):
    """Return an exponential rise [degC], 20 to 110 with 1500 s: a damper of one node, which two can be."""
    return 20.0 + 90.0 * (1.0 - np.exp(-time / 1500.0))


@pytest.fixture(scope="module")
def curve(tmp_path_factory):
    path = tmp_path_factory.mktemp("forecast") / "warm_up.csv"
    time = np.arange(0.0, 60.0 * MINUTES, 2.0)
    rows = np.column_stack([time, truth(time) + np.random.default_rng(3).normal(0.0, 0.2, time.size)])
    np.savetxt(path, rows, "%.3f", ",", header="time_s,wall_degC", comments="")
    return path


@pytest.fixture(scope="module")
def answer(curve, tmp_path_factory):
    out = tmp_path_factory.mktemp("forecast") / "out"
    options = ForecastOptions(limit_degC=80.0)
    return JOBS["forecast"].perform({"curve": curve}, options, out=out)[1], out


def test_the_interval_holds_what_comes(answer):
    told, _ = answer
    true = truth(np.array(told["time_s"]))
    inside = (np.array(told["low_degC"]) <= true) & (true <= np.array(told["high_degC"]))
    assert inside[np.array(told["time_s"]) > 60.0 * MINUTES].all()
    low, high = told["time_to_limit_interval_s"]
    assert low < 1500.0 * np.log(3.0) < high  # 80 of 20 + 90 (1 - exp(-t/1500))


def test_the_interval_widens_with_time(answer):
    told, _ = answer
    width = np.subtract(told["high_degC"], told["low_degC"])
    assert width[-1] > 3.0 * width[30] > 0.0


def test_files_and_figures(answer, curve):
    _, out = answer
    assert sorted(path.name for path in out.iterdir()) == [
        "forecast.csv",
        "forecast.html",
        "forecast.json",
        "forecast.svg",
    ]
    found = mrdamper.forecast(curve, limit_degC=80.0)
    assert "wall after 60 min" in found.summary()
    assert found.plot().axes[0].get_xlabel() == "minutes"


def test_a_forecast_goes_beyond_the_curve(curve):
    with pytest.raises(InputError, match="it lasts 598 s; expected 300 s of forecast to go beyond it"):
        JOBS["forecast"].perform({"curve": curve}, ForecastOptions(until_s=300.0))


def test_a_limit_below_ambient_is_refused(curve):
    with pytest.raises(InputError, match=r"the limit is 15 degC, ambient 20 degC; expected a limit above"):
        JOBS["forecast"].perform({"curve": curve}, ForecastOptions(limit_degC=15.0))
