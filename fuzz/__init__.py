"""Coverage-guided fuzzing of the kernel, the text reader, the model card and the channel map.

``python -m fuzz`` lists the targets; ``python -m fuzz NAME -runs=N`` runs one. Targets in Python run under
atheris. The kernel runs under clang's libFuzzer with the address and undefined-behaviour sanitizers.
"""
