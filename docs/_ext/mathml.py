"""Equations as MathML, which browsers display without a script, so that the pages work offline.

Without latex2mathml Sphinx uses MathJax, which the browser downloads.
"""

from __future__ import annotations

from importlib.util import find_spec

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.config import Config
from sphinx.writers.html5 import HTML5Translator


def set_inline(writer: HTML5Translator, node: nodes.math) -> None:
    """Write an equation inside a line."""
    from latex2mathml.converter import convert

    writer.body.append(convert(node.astext()))
    raise nodes.SkipNode


def set_block(writer: HTML5Translator, node: nodes.math_block) -> None:
    """Write a displayed equation."""
    from latex2mathml.converter import convert

    writer.body.append(f'<div class="math">{convert(node.astext(), display="block")}</div>\n')
    raise nodes.SkipNode


def choose(_app: Sphinx, config: Config) -> None:
    """Select this renderer if its library is installed."""
    if find_spec("latex2mathml") is not None:
        config.html_math_renderer = "mathml"  # type: ignore[attr-defined]


def setup(app: Sphinx) -> dict[str, bool]:
    """Add the renderer."""
    app.add_html_math_renderer("mathml", (set_inline, None), (set_block, None))
    app.connect("config-inited", choose)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
