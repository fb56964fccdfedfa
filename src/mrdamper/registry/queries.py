"""The questions that pages ask beside jobs: small, quick answers, computed in a process of their own."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

QUERIES: Mapping[str, str] = MappingProxyType(
    {
        "preview": "mrdamper.jobs.previews.runs:look",
        "preview_head": "mrdamper.jobs.previews.runs:glance",
        "findings": "mrdamper.jobs.previews.runs:findings_in",
        "channels": "mrdamper.jobs.channel_map:channels_toml",
        "runs": "mrdamper.jobs.previews.series:keep_runs",
        "window": "mrdamper.jobs.previews.series:keep_window",
        "model": "mrdamper.jobs.previews.series:keep_model",
        "heat_curve": "mrdamper.jobs.previews.heat:QuickHeat.curve",
        "damper": "mrdamper.jobs.previews.heat:damper_facts",
        "drawn": "mrdamper.jobs.previews.heat:draw_damper",
        "card": "mrdamper.jobs.previews.card:require_card",
        "catalogue": "mrdamper.jobs.public_data.datasets:catalogue",
    }
)
"""Function that answers a query, by name; loaded when it is first asked for."""
