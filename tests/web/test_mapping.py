"""Channel maps: offers of known maps, questions about missing values, and the quick loop."""

from __future__ import annotations

import shutil

import numpy as np
import pytest

from mrdamper.data.readers import read_file
from tests.web.browser import opened, shoot
from tests.web.served import served

pytestmark = pytest.mark.nightly

ACTIONS = 3


@pytest.fixture(scope="module")
def laboratory(tmp_path_factory):
    """Return the folder of runs, and a client of its server."""
    root = tmp_path_factory.mktemp("mapping") / "damper"
    with served(root) as client:
        yield root / "runs", client


@pytest.mark.parametrize(
    ("file", "offer"), [("ME5mm3Hz.txt", "utfsm logger"), ("ensaio.A.1.mat", "utfpr mat")]
)
def test_raw_file_maps_in_three_actions(browser, laboratory, real_data, file, offer):
    """Look, Use and Save give the runs of the packaged map; the loop is visible before saving."""
    runs, client = laboratory
    shutil.copy(real_data / "raw" / file, runs / file)
    with opened(browser, client.address) as page:
        page.goto("/#/runs")
        page.get_by_text("not understood").wait_for()
        actions = [
            lambda: page.get_by_label(f"Look into {file}").click(),
            lambda: page.get_by_role("button", name=f"Use {offer}").click(),
            lambda: page.click("#save-map"),
        ]
        for act in actions[:-1]:
            act()
        page.wait_for_selector("#preview .notice.good")
        assert page.locator("figure.plot", has_text="Loop of these columns").is_visible()
        shoot(page, f"mapping-{offer.split()[0]}", whole=True)
        actions[-1]()
        page.locator("tr", has_text=file).get_by_text("channels mapped by hand").wait_for()
        names = {run["name"] for run in client.read_all() if run["file"] == file}
    assert len(actions) <= ACTIONS
    assert names == {run.name for run in read_file(runs / file).recordings}


def test_unnamed_columns_map_by_answers(browser, laboratory):
    """Each question about unnamed columns is answered by a button, and the last answer gives a run."""
    runs, client = laboratory
    time = np.arange(2000) / 500.0
    travel, speed = 5.0 * np.sin(12.0 * time), 60.0 * np.cos(12.0 * time)
    force = 0.4 * np.tanh(speed / 5.0) + 0.002 * speed
    rows = "".join(f"{t:.4f},{x:.5f},{f:.6f},1.0\n" for t, x, f in zip(time, travel, force, strict=True))
    path = runs / "odd.csv"
    path.write_text("time_s,alpha,beta,current_A\n" + rows)
    with opened(browser, client.address) as page:
        page.goto("/#/runs?file=odd.csv")
        page.get_by_label("Which column is the displacement? alpha").click()
        page.get_by_label("Which column is the force? beta").click()
        assert page.locator("figure.plot", has_text="Loop of these columns").is_visible()
        page.get_by_label("In which unit is the displacement? mm", exact=True).click()
        shoot(page, "mapping-asked", whole=True)
        page.get_by_label("In which unit is the force? kN", exact=True).click()
        page.wait_for_selector("#preview .notice.good")
        page.click("#save-map")
        page.get_by_role("link", name="odd", exact=True).first.wait_for()
        client.read_all()
    (run,) = read_file(path).recordings
    assert np.ptp(run.displacement) == pytest.approx(0.01, rel=1e-3)
    assert run.force.max() == pytest.approx(1e3 * force.max(), rel=1e-3)
