"""The kernel's instruction counts: a guard on speed that a busy machine does not disturb."""

from __future__ import annotations

import pytest

from bench import instructions


@pytest.fixture(scope="module")
def program(tool, tmp_path_factory):
    return instructions.build(tmp_path_factory.mktemp("count"), str(tool("gcc")))


@pytest.mark.parametrize("part", instructions.PARTS)
def test_the_kernel_does_not_take_a_tenth_more_instructions(tool, program, part):
    """A growth that is meant is committed: ``python -m bench --instructions``."""
    kept = instructions.committed()
    here = instructions.toolchain()
    if here != kept["toolchain"]:
        pytest.skip(
            f"counts of {kept['toolchain']}, and this is {here}: renew with python -m bench --instructions"
        )
    found, before = instructions.count(program, part, str(tool("valgrind"))), kept["instructions"][part]
    assert found <= instructions.GROWTH * before, (
        f"{part}: {found:,} instructions, {found / before:.2f} x the committed {before:,}; if that is meant: "
        "python -m bench --instructions"
    )


def test_the_same_program_counts_the_same_twice(tool, program):
    valgrind = str(tool("valgrind"))
    assert instructions.count(program, "controller", valgrind) == instructions.count(
        program, "controller", valgrind
    )
