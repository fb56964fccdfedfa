"""Segments: which rows are held back for a record's rules, and where it breaks off."""

from __future__ import annotations

import numpy as np
import pytest
from mrdamper.data.batches import Batch
from mrdamper.data.segments import Count, Head, Segmenter, moved_by, usual_step


def rows(time: object) -> Batch:
    at = np.asarray(time, float)
    return Batch(0, at, 0.01 * np.sin(at), np.ones(len(at)), np.ones(len(at)))


@pytest.mark.parametrize("first", [0, 1, 2, 3, 4])
def test_a_head_holds_as_many_rows_as_it_is_asked_to(first):
    head, whole = Head(3), rows(range(5))
    left = head.take(whole.part(slice(first)))
    assert (bool(head), head.full, len(left)) == (first > 0, first >= 3, max(0, first - 3))
    beyond = head.take(whole.part(slice(first, None)))
    assert head.full
    assert (len(left) + len(beyond)) == 2
    assert (head.release().time.tolist(), bool(head)) == ([0.0, 1.0, 2.0], False)


def test_a_record_breaks_at_missing_rows_late_times_and_gaps_in_any_parts():
    time = np.arange(40.0)
    time[10] = np.nan
    time[20:] -= 2.0  # row 20 comes one second back
    time[30:] += 7.0
    for size in (1, 7, 40):
        segmenter = Segmenter(step_s=1.0)
        segments: list[list[int]] = []
        for start in range(0, 40, size):
            for fresh, part in segmenter.step_batch(rows(time).part(slice(start, start + size))):
                segments += [[]] if fresh else []
                segments[-1] += [*range(part.row, part.row + len(part))]
        assert segments == [[*range(10)], [*range(11, 20)], [*range(20, 30)], [*range(30, 40)]]
        missing, back, gap = segmenter.findings()
        assert [(each.kind, each.size) for each in (missing, back, gap)] == [
            ("missing_rows", 1.0), ("time_back", 1.0), ("gap", 8.0)]  # fmt: skip
        assert missing.from_s is missing.to_s is None
        assert (back.from_s, gap.from_s) == (18.0, 35.0)


def test_what_was_met_is_told_from_its_first_time_to_its_last():
    met = Count()
    assert met.finding("gap", "time", "", "", 0.0, "s") == []
    for times, sizes in (([np.nan], [3.0]), ([1.0, np.nan, 2.0], [1.0, 5.0, 2.0]), ([4.0], [1.0]), ([], [])):
        met.add(np.array(times), np.array(sizes))
    (found,) = met.finding("gap", "time", "", "", met.most, "s")
    assert (met.times, found.size, found.from_s, found.to_s) == (5, 5.0, 1.0, 4.0)


@pytest.mark.parametrize(("range_um", "moves"), [(49.9, False), (50.1, True)])
def test_a_motion_is_fifty_micrometres_but_for_outliers(range_um, moves):
    x = 1e-6 * range_um * (np.arange(2000) % 2)
    x[7] = 1.0
    assert moved_by(x) == pytest.approx(1e-6 * range_um if moves else 0.0)
    assert moved_by(np.empty(0)) == 0.0


def test_the_usual_step_is_the_median_of_those_that_go_on():
    assert usual_step(np.array([0.0, 1.0, 3.0, 3.0, 0.0, 2.0, np.nan, 7.0])) == 2.0
    for time in ([], [1.0], [2.0, 1.0]):
        assert usual_step(np.array(time)) is None
