"""The questions that pages ask beside jobs: small, quick answers, computed in a process of their own."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

__all__ = ["QUERIES"]

QUERIES: Mapping[str, str] = MappingProxyType(
    {
        "ready": "mrdamper.web.query_worker:load_previews",
        "preview": "mrdamper.jobs.preview:look",
        "preview_head": "mrdamper.jobs.preview:glance",
        "findings": "mrdamper.jobs.preview:findings_in",
        "channels": "mrdamper.jobs.preview:channels_toml",
        "runs": "mrdamper.jobs.series:keep_runs",
        "window": "mrdamper.jobs.series:keep_window",
        "model": "mrdamper.jobs.series:keep_model",
        "heat_curve": "mrdamper.jobs.heat_preview:QuickHeat.curve",
        "damper": "mrdamper.jobs.heat_preview:damper_facts",
        "card": "mrdamper.jobs.card_summary:require_card",
        "cite": "mrdamper.jobs.cite:cite",
        "catalogue": "mrdamper.jobs.datasets:catalogue",
    }
)
"""Function that answers a query, by name; loaded when it is first asked for."""
