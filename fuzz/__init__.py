"""Coverage-guided fuzzing: what reads a user's bytes is given millions of wrong ones.

``python -m fuzz`` lists the targets; ``python -m fuzz NAME -runs=N`` runs one. Targets in Python run under
atheris, targets in C under libFuzzer with the address and undefined-behaviour sanitizers. It is no part of
the package: nothing in ``src`` knows of it. docs/trust.md says what was run and found.
"""
