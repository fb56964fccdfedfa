"""Coverage-guided fuzzing of the kernel, the text reader, the model card and the channel map.

``python -m fuzz`` lists the targets; ``python -m fuzz NAME -runs=N`` runs one target. The fuzzer of the
Python targets is atheris. The fuzzer of the kernel is clang's libFuzzer with the address and
undefined-behaviour sanitizers.
"""
