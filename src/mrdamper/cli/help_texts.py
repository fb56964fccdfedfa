"""Texts of the help that do not belong to a single option: groups of commands, examples, exit codes."""

from __future__ import annotations

GROUPS = {
    "Data": ("data", "check", "cycles"),
    "Model": ("fit", "evaluate", "simulate", "compare", "fluid"),
    "Temperature": ("heat", "derate", "heatsink"),
    "Control": ("track", "export"),
    "Tools": ("rig", "sweep", "serve", "demo"),
}
"""Groups of commands with their commands, in the order of the help."""

EXAMPLES = {
    "check": ("lab", "lab --answer force.unit=kN --out findings"),
    "fit": ("lab --hold-out '*_060C_*' --out card", "lab --law double-bouc-wen --posterior 1000 --out card"),
    "evaluate": ("card.json lab/new_*.csv", "card.json lab --out errors"),
    "simulate": ("card.json sine:10mm:1Hz:1A:2s", "card.json lab/run_7.csv --out simulation"),
    "compare": ("new/card.json worn/card.json", "new/card.json worn/card.json --out comparison"),
    "cycles": ("endurance.csv", "endurance.csv --least-stroke-mm 2 --out cycles"),
    "heat": ("card.json --damper paper", "card.json --damper paper --duty sine:15mm:1Hz:2A:600s --out heat"),
    "derate": ("card.json --damper paper", "card.json --damper mine.toml --quantity stroke --out limits"),
    "heatsink": (
        "card.json --damper paper --network-only",
        "card.json --damper mine.toml --mass-g 300 --out sink",
    ),
    "fluid": ("viscosity.csv yield.csv --out fluid", "viscosity.csv --like lord-mrf-132dg --out fluid"),
    "track": (
        "card.json --target sine-900N-1Hz --out track",
        "card.json --controller recommended --temperature 60",
    ),
    "export": ("card.json --c c", "card.json --fmu damper.fmu --precision double --content model"),
    "rig": ("--out runs", "--preset stiff --campaign short --seed 3 --out runs"),
    "data list": ("", "--json"),
    "data fetch": ("utfsm", "utfsm --out runs"),
    "demo": ("", "--quick --out demo"),
    "sweep": ("labs/* --out fits", "--card card.json --samples 200 --out tolerance"),
    "serve": ("--open", "--folder work --port 9000"),
}
"""Arguments of two example calls of each command."""

EXIT_CODES = (
    ("0", "The command is complete."),
    ("1", "An internal error occurred. Please report it."),
    ("2", "An option or argument is invalid."),
    ("3", "The input is invalid, for example a file cannot be read."),
    ("4", "The command was interrupted or did not converge."),
    ("5", "A check failed: a run has a fault, or the exported code differs from the model."),
)
