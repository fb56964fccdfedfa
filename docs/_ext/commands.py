"""The directive ``commands``: usage, help and options of every command, from the command line itself."""

from __future__ import annotations

import re
from collections.abc import Iterator
from inspect import cleandoc

import click
from docutils import nodes
from figures import parsed
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from mrdamper.cli import cli


def every_command(group: click.Group, name: str) -> Iterator[tuple[str, click.Command]]:
    """Generate each command of a group and of its subgroups, with its complete name."""
    for command in sorted(group.commands.values(), key=lambda command: command.name or ""):
        full_name = f"{name} {command.name}"
        if isinstance(command, click.Group):
            yield from every_command(command, full_name)
        else:
            yield full_name, command


def described(name: str, command: click.Command) -> str:
    """Return one command as Markdown."""
    context = click.Context(command, info_name=name)
    rows = [
        parameter.get_help_record(context)
        for parameter in command.get_params(context)
        if isinstance(parameter, click.Option)
    ]
    usage = " ".join([name, *command.collect_usage_pieces(context)])
    help_text = cleandoc(command.help or "")
    lines = [
        f"**{name}**",
        "",
        f"```text\n{usage}\n```",
        "",
        help_text,
        "",
        "| option | meaning |",
        "|---|---|",
    ]
    for cells in filter(None, rows):
        option, meaning = (" ".join(cell.split()).replace("|", r"\|") for cell in cells)
        meaning = re.sub(r"--[\w-]+", r"`\g<0>`", meaning)  # Two hyphens in text become a dash.
        lines.append(f"| `{option}` | {meaning} |".replace("*", r"\*"))
    return "\n".join(lines)


class Commands(SphinxDirective):
    """A section of text for each command."""

    def run(self) -> list[nodes.Node]:
        text = "\n\n".join(described(name, command) for name, command in every_command(cli, "mrdamper"))
        return parsed(self, text)


def setup(app: Sphinx) -> dict[str, bool]:
    """Add the directive."""
    app.add_directive("commands", Commands)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
