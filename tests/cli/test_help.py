"""Help texts of the command line: width, complete sentences, valid examples, and exit codes."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator

import click
import pytest
from click.testing import CliRunner

from mrdamper.cli import cli
from mrdamper.cli.commands import EXAMPLES, EXIT_CODES, GROUPS

COMMANDS = sorted(EXAMPLES)


def help_of(*arguments: str) -> str:
    result = CliRunner().invoke(cli, [*arguments, "--help"], prog_name="mrdamper", terminal_width=80)
    assert result.exit_code == 0
    return result.output


def option_texts(name: str) -> Iterator[tuple[str, str]]:
    command: click.Command = cli
    for word in name.split():
        assert isinstance(command, click.Group)
        command = command.commands[word]
    for parameter in command.get_params(click.Context(command)):
        if isinstance(parameter, click.Option):
            yield parameter.opts[0], re.sub(r"\s*\[default: .*\]$", "", parameter.help or "")


def test_command_groups_contain_every_command():
    assert sorted(name for names in GROUPS.values() for name in names) == sorted(cli.commands)


@pytest.mark.parametrize("name", ["", *COMMANDS])
def test_help_fits_80_columns(name):
    lines = help_of(*name.split()).splitlines()
    assert max(map(len, lines)) <= 80
    assert not [line for line in lines if line.endswith("...") and "[" not in line]


@pytest.mark.parametrize("name", COMMANDS)
def test_help_text_of_option_is_sentence(name):
    """The text begins with an imperative and ends with a full stop."""
    for option, text in option_texts(name):
        assert re.match(r"[A-Z][a-z]+ .*(\.|\.\.\.)$", text, re.DOTALL), f"{option}: {text!r}"
        assert text.split()[0] not in {"Of", "For", "The", "A", "In", "What"}, f"{option}: {text!r}"


@pytest.mark.parametrize("name", COMMANDS)
def test_help_ends_with_examples_and_exit_codes(name):
    text = help_of(*name.split())
    assert len(EXAMPLES[name]) == 2
    for arguments in EXAMPLES[name]:
        assert f"mrdamper {name} {arguments}".rstrip() in text
    assert all(f"  {code}  " in text for code, _ in EXIT_CODES)


@pytest.mark.parametrize("name", COMMANDS)
def test_examples_in_help_are_valid_commands(name):
    """Click accepts the options and arguments of each example in the help."""
    for arguments in EXAMPLES[name]:
        command: click.Command = cli
        for word in name.split():
            assert isinstance(command, click.Group)
            command = command.commands[word]
        command.make_context(name, shlex.split(arguments))
