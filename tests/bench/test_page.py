"""The page of benchmarks says what the kept results hold, and those have the form that was promised."""

from __future__ import annotations

import json
import re

import pytest

from bench import __main__ as command
from bench import page

RESULTS = json.loads(page.RESULTS.read_text(encoding="utf-8"))
NAMES = [name for name in RESULTS if name not in page.NOT_RESULTS]


def test_the_page_is_made_from_the_kept_results():
    """Renew it with ``python -m bench --page``."""
    text = page.PAGE.read_text(encoding="utf-8")
    assert page.written(text, RESULTS) == text


def test_a_changed_figure_changes_the_page():
    text = page.PAGE.read_text(encoding="utf-8")
    changed = json.loads(json.dumps(RESULTS))
    changed["simulation"][0]["ns_per_sample"] *= 2.0
    assert page.written(text, changed) != text


def test_every_kept_benchmark_is_on_the_page():
    text = page.PAGE.read_text(encoding="utf-8")
    assert [name for name in NAMES if f"<!-- bench:{name} -->" not in text] == []


def test_every_section_of_the_page_has_kept_results():
    text = page.PAGE.read_text(encoding="utf-8")
    sections = set(re.findall(r"<!-- bench:(\w+) -->", text)) - {"machine"}
    assert sections == set(NAMES)
    assert sections == set(command.NAMES)
    assert "*Not kept." not in text


@pytest.mark.parametrize("name", NAMES)
def test_every_row_names_a_contender_with_a_time_or_a_reason(name):
    for row in RESULTS[name]:
        assert row["contender"]
        assert {"cpu_s", "ns_per_sample", "ratio", "accuracy"} & row.keys()
        assert row.get("state") not in {"absent", "disqualified"} or "ratio" not in row


def test_the_machine_and_the_versions_are_recorded():
    assert {"processor", "system", "python", "packages", "programs"} <= RESULTS["machine"].keys()
    assert {"mrdamper", "numpy", "scipy"} <= RESULTS["machine"]["packages"].keys()
    assert RESULTS["runs"].keys() == set(NAMES)


def test_rows_come_back_from_json_as_they_were():
    rows = page.rows_of(RESULTS["simulation"])
    assert json.loads(json.dumps([row.as_json() for row in rows])) == RESULTS["simulation"]


def test_the_picture_of_growth_has_every_size_in_order():
    lines = page.growth_lines(RESULTS["growth"])
    assert {"samples", "candidates", "runs", "threads"} <= lines.keys()
    assert [count for count, _ in lines["candidates"]] == [1, 16, 256, 1024, 4096]
    assert all(points == sorted(points) for points in (lines["samples"], lines["runs"]))


def test_the_picture_of_searches_shows_what_met_a_cost():
    points = page.search_points(page.rows_of(RESULTS["identification"]))
    assert points["variable projection, 5 starts"][0] == 1.0
    assert len(points) >= 6
    assert all(ratio > 0.0 and cost > 0.9 for ratio, cost in points.values())


def test_pictures_are_drawn_from_the_kept_results(tmp_path):
    drawn = page.draw(RESULTS, tmp_path)
    assert {path.name for path in drawn} == {
        f"bench_{name}.png" for name in ("accuracy", "growth", "identification", "startup")
    }
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in drawn)
