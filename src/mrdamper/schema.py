"""Records declared once: what JSON and TOML hold."""

from __future__ import annotations

from typing import Any

__all__ = ["Json"]

Json = dict[str, Any]
"""An object of JSON, or a table of TOML."""
