"""Faults put into an exported controller while it runs: into its state, its parameters and their block.

``python -m tests.export.injected [--faults N]`` prints, for the predictive controller compiled here: how many
commands are none; after how long no flag of a fault is left that the sound controller does not raise (it
controls again); and after how long its command is within 5 % of the largest of the sound one's for good: what
remembers long travel takes long travel to learn. The last is cut off by the end of the run, after 1 s.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

from mrdamper.codegen.target import Target, target_of
from mrdamper.models.actuation import Actuation
from tests.control.dampers import CHAIN, DAMPERS
from tests.export.exports import STRICT, card_of, ran, write

PLACES = ("state", "what a step remembers", "data in RAM", "block of parameters")
UNITS = ("damper.c", "damper_tables.c", "damper_parameters.c")

PROGRAM = r"""
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "damper_parameters.h"
enum { STEPS = 1500, AFTER = 1000, AT = 400 };
typedef struct {
    damper_controller_state state;
    damper_controller_held held;
    damper_parameters block;
} memory;
static memory sound, hit;
static double usual[STEPS];
static unsigned raised[STEPS];
static unsigned seed = 1;
static unsigned drawn(unsigned below) { seed = seed * 1664525u + 1013904223u; return (seed >> 8) % below; }
static double step(memory *m, int i, unsigned *flags)
{
    const double t = 1e-3 * i;
    const mrd_real x = (mrd_real)(6e-3 * sin(7 * t) + 3e-3 * sin(19 * t)), none = (mrd_real)NAN;
    const mrd_real wanted = (mrd_real)(600 * tanh((0.042 * cos(7 * t) + 0.057 * cos(19 * t)) / 0.02));
    const damper_controller_input in = {wanted, none, x, (mrd_real)(330 + 1e-3 * (i % 3)), none, none};
    damper_controller_output out;
    damper_controller_step_checked(&m->held, &m->state, &m->block, &in, &out);
    *flags = (unsigned)out.flags
           & (MRD_INTERNAL_FAULT | MRD_MOTION_UNKNOWN | MRD_FROZEN | MRD_TEMPERATURE_JUMP);
    return isfinite(out.force) ? (double)out.current : NAN;
}
static void spoil(memory *m, int place)
{
    unsigned char *const at[] = {(unsigned char *)&m->state, (unsigned char *)&m->state,
                                 (unsigned char *)&m->held.data, (unsigned char *)&m->block};
    const size_t lines = offsetof(damper_controller_state, delay_line);
    const size_t behind = offsetof(damper_controller_state, at);
    const size_t whole = sizeof m->state, left = lines + (whole - behind);
    const size_t size[] = {whole, left, sizeof m->held.data, sizeof m->block};
    static const double cannot[] = {NAN, INFINITY, -INFINITY};
    size_t byte = drawn((unsigned)size[place]);
    if (place == 1 && byte >= lines) byte += behind - lines;
    if (place < 2 && drawn(2)) {
        const mrd_real value = (mrd_real)cannot[drawn(3)];
        memcpy(at[place] + byte / sizeof value * sizeof value, &value, sizeof value);
    } else {
        at[place][byte] ^= (unsigned char)(1u << drawn(8));
    }
}
int main(int count, char **argument)
{
    const int place = atoi(argument[1]), faults = atoi(argument[2]);
    if (count < 3) return 2;
    const double most = (double)damper_controller_data.axes.largest;
    damper_controller_start(&sound.state);
    damper_parameters_default(&sound.block);
    damper_controller_hold(&sound.held, &sound.state, &sound.block);
    memory run = sound;
    for (int i = 0; i < STEPS; i++) {
        usual[i] = step(&run, i, &raised[i]);
    }
    for (int k = 0; k < faults; k++) {
        int last = 0, none = 0, flagged = 0;
        unsigned flags;
        const int at = AT + (int)drawn(STEPS - AFTER - AT);
        hit = sound;
        for (int i = 0; i < STEPS; i++) {
            if (i == at) spoil(&hit, place);
            const double given = step(&hit, i, &flags);
            if (i >= at && (flags & ~raised[i])) flagged = i + 1 - at;
            if (!(given >= 0.0 && given <= most)) none++;
            else if (i >= at && fabs(given - usual[i]) > 0.05 * most) last = i + 1 - at;
        }
        printf("%d %d %d\n", none, flagged, last);
    }
    return 0;
}
"""


@dataclass(frozen=True, slots=True)
class Injected:
    """What faults of one place did."""

    place: str
    faults: int
    not_finite: int  # steps whose command or force is none, or beyond its limits
    restarts_ms: tuple[int, ...]  # until it controls again, of each fault, in ascending order
    alike_ms: tuple[int, ...]  # until its command is the sound one's


def predictive_target(law: str = "double-bouc-wen") -> Target:
    """Return the predictive controller of a damper with lags."""
    damper = replace(DAMPERS.get(law, CHAIN), actuation=Actuation(0.004, 0.004))
    return target_of(card_of(damper), content="controller", controller="predictive")


def inject(target: Target, folder: Path, faults: int) -> list[Injected]:
    """Return what ``faults`` faults of each place did to an export, compiled in a folder."""
    write(target, folder)
    (folder / "faulty.c").write_text(PROGRAM, encoding="ascii")
    compiler = shutil.which("gcc") or "cc"
    ran(compiler, *STRICT[:2], "faulty.c", *UNITS, "-lm", "-o", "faulty", cwd=folder)
    found = []
    for place, name in enumerate(PLACES):
        rows = [line.split() for line in ran("./faulty", place, faults, cwd=folder).splitlines()]
        none, flagged, late = (sorted(int(each) for each in column) for column in zip(*rows, strict=True))
        found.append(Injected(name, faults, sum(none), tuple(flagged), tuple(late)))
    return found


def main() -> None:
    """Print what was found for a law with and one without its own steps."""
    parser = argparse.ArgumentParser(prog="python -m tests.export.injected")
    parser.add_argument("--faults", type=int, default=100, help="into each place")
    faults = parser.parse_args().faults
    print(
        "| law | place | faults | commands that are none | controls again: longest [ms] "
        "| as before: median, longest [ms] |"
    )
    print("|---|---|---|---|---|---|")
    for law in ("double-bouc-wen", "chain"):
        with tempfile.TemporaryDirectory() as folder:
            for each in inject(predictive_target(law), Path(folder), faults):
                late = each.alike_ms
                print(
                    f"| {law} | {each.place} | {faults} | {each.not_finite} | {each.restarts_ms[-1]} "
                    f"| {late[faults // 2]}, {late[-1]} |"
                )


if __name__ == "__main__":
    main()
