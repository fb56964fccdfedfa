"""Run the fuzzing: ``python -m fuzz [NAME ...] [-runs=N] [OPTION ...]``; without a name, the list of targets.

``all`` is every target, ``python`` and ``c`` those of one kind. What begins with a dash goes to the engine
(libFuzzer's options). The inputs that it finds stay in build/fuzz/NAME; one that breaks a promise is left
there as crash-*, and belongs into fuzz/corpus/NAME with its fix.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from importlib import import_module
from importlib.machinery import FileFinder, ModuleSpec, SourceFileLoader
from pathlib import Path
from typing import Any

from fuzz import native

__all__ = ["main"]

BUILD = Path("build/fuzz")
_SECONDS = 120  # for one input, on a machine that has other work
_MEGABYTES = 4096
_SEEN = ["mrdamper", "nptdms", "tomllib", "fuzz.calls"]  # packages whose branches guide the search
_APART = "--here"  # asked of the process that runs one target


def main(given: list[str]) -> int:
    """Run what is asked for; return 1 when a target broke a promise."""
    options = [each for each in given if each.startswith("-")]
    asked = [each for each in given if not each.startswith("-")]
    if _APART in options:
        options.remove(_APART)
        _run_here(asked[0], options)
    kinds = {"python": [*_targets()], "c": [*native.TARGETS]}
    kinds["all"] = [*kinds["c"], *kinds["python"]]
    names = [name for each in asked for name in kinds.get(each, [each])]
    unknown = [name for name in names if name not in kinds["all"]]
    if unknown or not names:
        print("targets in Python:", *kinds["python"], "\ntargets in C:", *kinds["c"])
        return 2 if unknown else 0
    failed = [name for name in names if not _run_apart(name, options)]
    if failed:
        print(f"promises broken by: {', '.join(failed)}; the inputs are in {BUILD}/")
    return bool(failed)


def _targets() -> dict[str, Any]:
    return dict(import_module("fuzz.targets").TARGETS)


def _run_apart(name: str, options: list[str]) -> bool:
    """Run one target in a process of its own; tell how far it came."""
    place = BUILD / name
    place.mkdir(parents=True, exist_ok=True)
    if name in native.TARGETS:
        kept = Path(__file__).with_name("corpus") / name
        for k, seed in enumerate(native.seeds(name)):
            (place / f"seed-{k}").write_bytes(seed)
        inputs = [str(each) for each in (place, kept) if each.is_dir()]
        command = [str(native.built(name, BUILD)), *_engine_options(place, native.LONGEST), *options, *inputs]
    else:
        command = [sys.executable, "-m", "fuzz", name, _APART, *options]
    begun, log = time.monotonic(), place.with_suffix(".log")
    with log.open("wb") as stream:
        done = subprocess.run(command, stdout=stream, stderr=subprocess.STDOUT, check=False)
    seconds = time.monotonic() - begun
    lines = log.read_text(encoding="utf-8", errors="replace").splitlines()
    count = next((line.split()[1] for line in reversed(lines) if line.startswith("Done ")), "")
    said = f"{count} executions, {float(count) / seconds:.0f} /s" if count else f"broke off; see {log}"
    print(f"{name:>16}: {said}, {seconds:.0f} s", flush=True)
    return done.returncode == 0


def _engine_options(place: Path, longest: int) -> list[str]:
    return [
        f"-max_len={longest}",
        f"-timeout={_SECONDS}",
        f"-rss_limit_mb={_MEGABYTES}",
        f"-artifact_prefix={place}/",
        "-print_final_stats=1",
    ]


def _run_here(name: str, options: list[str]) -> None:
    """Run a target in this process, which ends with it."""
    os.environ.setdefault("POLARS_MAX_THREADS", "1")
    import atheris

    sys.meta_path.insert(0, _Sources)
    with atheris.instrument_imports(include=_SEEN):
        targets = import_module("fuzz.targets")
    target, place = targets.TARGETS[name], BUILD / name
    place.mkdir(parents=True, exist_ok=True)
    for k, seed in enumerate(target.seeds()):
        (place / f"seed-{k}").write_bytes(seed)
    for path in targets.kept_inputs(name):
        shutil.copyfile(path, place / f"kept-{path.name}")
    atheris.Setup([sys.argv[0], *_engine_options(place, target.longest), *options, str(place)], target.take)
    atheris.Fuzz()


class _Sources:
    """Finds the package's Python files in ``src``: what an editable install's finder loads is not seen."""

    @staticmethod
    def find_spec(name: str, path: Sequence[str] | None = None, _target: object = None) -> ModuleSpec | None:
        if name.partition(".")[0] != "mrdamper":
            return None
        folders = [str(Path(__file__).parents[1] / "src")] if path is None else path
        found = (FileFinder(folder, (SourceFileLoader, [".py"])).find_spec(name) for folder in folders)
        return next((spec for spec in found if spec is not None), None)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
