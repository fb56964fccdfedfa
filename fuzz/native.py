"""Targets in C: built with clang's libFuzzer and the address and undefined-behaviour sanitizers.

``laws`` is the kernel's laws, ``tables`` a controller's configuration and tables as the binding takes them,
and the ``exported`` ones what ``mrdamper export --c`` writes for a card, in both number types and of both
kinds of law.
"""

from __future__ import annotations

import subprocess
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any
from unittest import mock

import numpy as np

from mrdamper.control.config import Config, config_values

__all__ = ["COMPILER", "LONGEST", "TARGETS", "built", "seeds"]

COMPILER = "clang"
LONGEST = 2048  # bytes of an input

_HERE = Path(__file__).with_name("kernel")
_CORE = Path(__file__).parents[1] / "src/mrdamper/core"
_FLAGS = (
    *("-std=c99", "-gline-tables-only", "-O1", "-ffp-contract=off", "-fno-omit-frame-pointer"),
    *("-fsanitize=fuzzer,address,undefined", "-fno-sanitize-recover=all"),
    "-fno-sanitize-coverage=trace-cmp",  # of numbers it tells nothing, and takes half of the time
)

Options = Mapping[str, str]

TARGETS: Mapping[str, Options] = MappingProxyType(
    {
        "laws": {},
        "tables": {},
        "exported": {"law": "double-bouc-wen", "precision": "double"},
        "exported-float": {"law": "double-bouc-wen", "precision": "float"},
        "exported-series": {"law": "series-valve", "precision": "double"},
        "exported-series-float": {"law": "series-valve", "precision": "float"},
    }
)
"""Name -> what is exported for it."""


def built(name: str, folder: Path) -> Path:
    """Return the program of a target, compiled into a folder; an error shows what the compiler says."""
    place, program = folder / f"{name}.c", folder / f"{name}.run"
    place.mkdir(parents=True, exist_ok=True)
    includes: list[Path] = [_HERE, _CORE / "kernel", _CORE / "binding"]
    sources = [_HERE / f"{name}.c"]
    if name == "tables":
        (place / "parts.h").write_text("\n".join(_parts()), encoding="ascii")
        includes.append(place)
    elif name != "laws":
        from mrdamper.codegen.c_code import c_files
        from tests.export.exports import a_target

        for file, text in c_files(a_target(**TARGETS[name])).items():
            (place / file).write_text(text, encoding="utf-8")
        includes = [_HERE, place]
        sources = [_HERE / "exported.c", place / "damper.c", place / "damper_tables.c"]
    command = [
        COMPILER,
        *_FLAGS,
        *(f"-I{each}" for each in includes),
        *map(str, sources),
        "-o",
        str(program),
        "-lm",
    ]
    subprocess.run(command, check=True)
    return program


def seeds(name: str) -> list[bytes]:
    """Return inputs to start from: each law, each kind of input, and ordinary readings."""
    ramp = bytes((37 * k + k // 5) % 256 for k in range(600))
    if name == "laws":
        return [bytes([law, kind, 9]) + ramp for law in range(9) for kind in (0, 4)]
    return [ramp, bytes(range(256)) * 2, bytes([1]) + ramp]


# ------------------------------------------------------------------------------------------- tables in C


def _parts() -> Iterator[str]:
    """Give a header with the tables of controllers: those that the package hands to its binding."""
    from mrdamper import core
    from tests.export.exports import a_target

    taken: list[tuple[tuple[Any, ...], dict[str, Any]]] = []

    def take(*given: Any, **options: Any) -> Any:  # noqa: ANN401 - as the binding's own
        taken.append((given, options))
        return tracker(*given, **options)

    tracker = core.Tracker
    with mock.patch.object(core, "Tracker", take):
        a_target.__wrapped__("double-bouc-wen", precision="double")
        a_target.__wrapped__("series-valve", precision="double")
    for k, (given, options) in enumerate(taken):
        yield from _part(f"p{k}", given, options.get("series"))
    yield f"#define PARTS {len(taken)}"
    yield f"#define CONFIG_VALUES {len(_numbers(taken[0][0][0]))}"
    yield f"static const tracker_parts *const all_parts[] = {_list(f'&p{k}' for k in range(len(taken)))};\n"


def _numbers(config: Config) -> list[float]:
    return [float(value) for part in config_values(config).values() for value in part.values()]


def _part(name: str, given: Sequence[Any], series: Sequence[Any] | None) -> Iterator[str]:
    config, rows, current, factor, column, lookups = given
    numbers = np.array(_numbers(config))
    arrays = {"config": numbers, "t0": current, "t1": factor, "t2": column}
    arrays |= {f"t{3 + k}": lookup[3] for k, lookup in enumerate(lookups)}
    tables = [each for each in arrays if each != "config"]
    fields = [
        f"{name}_config",
        *map(str, (len(current), column.shape[1], factor.shape[0], factor.shape[1])),
        f"{name}_row",
        _list(f"{name}_{each}" for each in tables),
        _list(str(arrays[each].size) for each in tables),
        *(_list(f"{lookup[k]!r}" for lookup in lookups) for k in range(3)),
    ]
    if series is not None:
        force, chain, powers, functions = series
        valve = [
            force,
            chain,
            *(table for power in powers for table in power[4:]),
            *(each[3] for each in functions),
        ]
        arrays |= {f"s{k}": table for k, table in enumerate(valve)}
        fields += [
            *map(str, (1, force.shape[1], force.shape[0], force.shape[2], chain.shape[1])),
            _list(f"{name}_s{k}" for k in range(len(valve))),
            _list(str(table.size) for table in valve),
            *(_list(f"{power[k]!r}" for power in powers) for k in range(4)),
            *(_list(f"{each[k]!r}" for each in functions) for k in range(3)),
        ]
    for key, values in arrays.items():
        yield f"static const double {name}_{key}[] = {_list(float(v).hex() for v in values.ravel())};"
    yield f"static const uint8_t {name}_row[] = {_list(map(str, rows))};"
    yield f"static const tracker_parts {name} = {_list(fields)};"


def _list(items: Iterator[str] | Sequence[str] | map[str]) -> str:
    return "{" + ", ".join(items) + "}"
