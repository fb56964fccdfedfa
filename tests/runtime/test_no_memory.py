"""Large pieces of memory of a command are refused, one at a time: what stood there stands there still.

The pieces are those of C's ``malloc``: arrays of NumPy and of the kernel, and Python's long texts.
"""

from __future__ import annotations

import random
import re
import signal
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.runtime.test_no_room import COMMANDS, FLUID, asked
from tests.support.kills import CAMPAIGN, Nursery, left_behind, of_any_folder, written
from tests.support.tracked import write_a_card

pytestmark = pytest.mark.nightly

LARGE = 1 << 15  # bytes: 4096 numbers
TRIED = 8  # of the pieces of a command that asks for more
DIED = {(-signal.SIGSEGV, 0), (-signal.SIGABRT, 0)}  # NumPy does when some copies of an array get no memory
SMALL_RUNS = CAMPAIGN.replace(', "nonperiodic"', "").replace("60.0, 100.0", "60.0")
_REFUSES = """
#include <errno.h>
#include <stddef.h>
extern void *__libc_malloc(size_t), *__libc_calloc(size_t, size_t), *__libc_realloc(void *, size_t);
static __thread int watched;
static long refused = -1, seen;
long refuse_allocation(long number)
{
    long so_far = seen;
    watched = 1, refused = number, seen = 0;
    return so_far;
}
static int refuses(size_t size)
{
    if (!watched || size < LARGE || seen++ != refused) return 0;
    errno = ENOMEM;
    return 1;
}
void *malloc(size_t n) { return refuses(n) ? NULL : __libc_malloc(n); }
void *calloc(size_t n, size_t of) { return refuses(n * of) ? NULL : __libc_calloc(n, of); }
void *realloc(void *old, size_t n) { return refuses(n) ? NULL : __libc_realloc(old, n); }
"""


@pytest.fixture(scope="module")
def scarce(tmp_path_factory: pytest.TempPathFactory, tool: Callable[[str], Path]) -> Iterator[Nursery]:
    """Give a nursery whose commands can be refused a piece of memory."""
    folder = tmp_path_factory.mktemp("scarce")
    (folder / "refuses.c").write_text(_REFUSES, encoding="utf-8")
    library = folder / "refuses.so"
    subprocess.run(
        [tool("cc"), f"-DLARGE={LARGE}", "-shared", "-fPIC", "-O1", "-o", library, folder / "refuses.c"],
        check=True,
    )
    (folder / "campaign.toml").write_text(SMALL_RUNS, encoding="utf-8")
    (folder / "fluid.csv").write_text(FLUID, encoding="utf-8")
    write_a_card(folder / "card.json")
    with Nursery(folder, library) as running:
        assert running.run("rig", "--campaign", "campaign.toml", "--out", "runs") == 0, running.said
        yield running


@pytest.mark.parametrize("name", sorted({*COMMANDS} - {"sweep"}))
def test_a_piece_of_memory_that_is_refused_costs_no_file(scarce: Nursery, tmp_path: Path, name: str):
    """The command ends in one message, or does without: its files are then those of an untroubled one.

    Where a library ends the process, that is as if it had been killed.
    """
    out = tmp_path / "out"
    assert scarce.run(*asked(name, out), "--json", refused=-1) == 0, scarce.said
    reference = of_any_folder(written(out), out)
    found = re.search(r"allocations (\d+)", scarce.said)
    assert found is not None
    pieces = range(int(found[1]))
    assert len(pieces) > 3
    tried = random.Random(name).sample(pieces, min(TRIED, len(pieces)))
    for number in sorted({0, *tried, pieces[-1]}):
        place = tmp_path / f"{number}" / "out"
        place.mkdir(parents=True)
        (place / "card.json").write_text('"older"', encoding="utf-8")
        before = written(place)
        code = scarce.run(*asked(name, place), "--json", refused=number)
        told = [line for line in scarce.said.splitlines() if line.startswith("mrdamper: ")]
        assert (code, len(told)) in {(0, 0), (3, 1), *DIED}, (number, code, scarce.said[-2000:])
        whole = {**of_any_folder(before, place), **reference}
        assert code != 3 or "memory" in told[0], (number, told)
        found_there = of_any_folder(written(place), place)
        if not (
            name == "check" and code == 3 and "runs/" in told[0]
        ):  # tells of a file, and checks the others
            assert found_there in ([before, whole] if code else [whole]), (
                number
            )  # refused after the last file
        if left_behind(place.parent):  # by a folder that could not be removed: the next job there does it
            assert scarce.run(*asked(name, place), "--json") == 0, scarce.said
            assert of_any_folder(written(place), place) == whole
            assert left_behind(place.parent) == []
