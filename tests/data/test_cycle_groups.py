"""Groups of cycles hold what their cycles do, in whatever parts these come."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mrdamper.data.cycle_groups import Groups

from mrdamper.data import cycle_groups


@pytest.mark.parametrize(("cycles", "size"), [(1, 1), (7, 1), (8, 2), (15, 2), (16, 4), (37, 8), (64, 16)])
@pytest.mark.parametrize("part", [1, 5, 100])
def test_a_group_has_the_mean_least_and_most_of_its_cycles(monkeypatch, cycles, size, part):
    """Of eight groups, four are made; a figure that a cycle lacks does not count."""
    monkeypatch.setattr(cycle_groups, "MOST_GROUPS", 4)
    rng = np.random.default_rng(cycles)
    values = rng.standard_normal((cycles, 3))
    values[rng.random(cycles) < 0.4, 1] = values[:16, 1] = np.nan
    values[:, 2] = np.nan
    groups = Groups(("force", "temperature", "none"))
    for start in range(0, cycles, part):
        groups.feed(values[start : start + part])
    groups.close()
    assert groups.size == size
    edges = range(size, cycles, size)
    of_groups = np.split(values, edges)
    numbers = np.split(np.arange(1.0, cycles + 1.0), edges)
    assert groups.number == pytest.approx([each.mean() for each in numbers])
    curves = groups.curves()["figures"]
    assert "none" not in curves
    assert groups.summary("none") is None
    assert groups.total("none") == 0.0
    for k, name in enumerate(("force", "temperature")):
        of_figure = [each[np.isfinite(each[:, k]), k] for each in of_groups]
        there = np.array([len(each) for each in of_figure])
        summary = groups.summary(name)
        assert groups.total(name) == pytest.approx(np.nansum(values[:, k]))
        if not there.any():
            assert summary is None
            assert name not in curves
            continue
        assert summary is not None
        sides: dict[str, Any] = {"mean": np.mean, "least": np.min, "most": np.max}
        assert [*curves[name]] == [*sides][: 3 if size > 1 else 1]
        for side in curves[name]:
            known = [float(sides[side](each)) if len(each) else np.nan for each in of_figure]
            shown = np.array(curves[name][side], float)
            assert shown == pytest.approx(np.array(known), rel=1e-6, nan_ok=True)
        means = [float(each.mean()) for each in of_figure if len(each)]
        expected = (np.nanmean(values[:, k]), np.nanmin(values[:, k]), np.nanmax(values[:, k]))
        assert (summary.mean, summary.least, summary.most) == pytest.approx(expected)
        assert (summary.first, summary.last) == pytest.approx((means[0], means[-1]))
        assert (summary.slope is None) == (summary.trend_per_1000_cycles is None) == (len(means) == 1)
        if len(means) > 1:
            line = np.polyfit(groups.number[there > 0], means, 1, w=np.sqrt(there[there > 0]))
            assert summary.trend_per_1000_cycles == pytest.approx(1000.0 * line[0])
