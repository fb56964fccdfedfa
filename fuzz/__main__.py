"""Run the fuzzing: ``python -m fuzz [NAME ...] [-runs=N] [OPTION ...]``; without a name, the list of targets.

``python`` and ``c`` are the targets of one kind, ``all`` is all of them. What begins with a
dash goes to the engine (libFuzzer's options). The inputs that it finds stay in build/fuzz/NAME; one that
breaks a promise is left as build/fuzz/NAME.crash-*, and belongs into fuzz/corpus/NAME with its fix.
"""

from __future__ import annotations

import ctypes
import io
import os
import shutil
import sys
import tempfile
import traceback
from collections.abc import Sequence
from contextlib import redirect_stderr
from importlib import import_module
from importlib.machinery import FileFinder, ModuleSpec, SourceFileLoader
from pathlib import Path
from typing import Any, NoReturn

from fuzz import native

__all__ = ["main"]

BUILD = Path("build/fuzz")
_MEMORY = "/dev/shm" if Path("/dev/shm").is_dir() else None  # a file system in memory
_PART = 100_000  # executions of one process
_SECONDS = 120  # for one input, on a machine that has other work
_MEGABYTES = 4096
_SEEN = ["mrdamper", "nptdms", "fuzz.calls"]  # whose branches guide the search; the parsers of others do not


def main(given: list[str]) -> int:
    """Run what is asked for; return 1 when a target broke a promise."""
    options = [each for each in given if each.startswith("-")]
    asked = [each for each in given if not each.startswith("-")]
    python = {} if asked and set(asked) <= {"c", *native.TARGETS} else _targets()
    kinds = {"c": [*native.TARGETS], "all": [*native.TARGETS, *python]}
    kinds["python"] = [*python]
    names = [name for each in asked for name in kinds.get(each, [each])]
    unknown = [name for name in names if name not in kinds["all"]]
    if unknown or not names:
        for kind in ("python", "c"):
            print(f"{kind}:", *kinds[kind])
        return 2 if unknown else 0
    if "all" in asked:
        _check_corpus(kinds["all"])
    failed = [name for name in names if not _run(name, python.get(name), options)]
    if failed:
        print(f"promises broken by: {', '.join(failed)}; the inputs are in {BUILD}/")
    return bool(failed)


def _check_corpus(names: Sequence[str]) -> None:
    """End where a kept input belongs to no target, or where the contract lets pass what it must not."""
    corpus = Path(__file__).with_name("corpus")
    strays = [path for path in corpus.rglob("*") if path.is_file() and path.parent.name not in names]
    if strays:
        sys.exit(f"no target takes {', '.join(map(str, strays))}")
    import_module("fuzz.contract").check_contract()


def _targets() -> dict[str, Any]:
    """Return the targets in Python, with what they call instrumented."""
    os.environ.setdefault("POLARS_MAX_THREADS", "1")
    import atheris

    sys.meta_path.insert(0, _Sources)
    with (
        redirect_stderr(io.StringIO()),
        atheris.instrument_imports(include=_SEEN),
    ):
        return dict(import_module("fuzz.targets").TARGETS)


def _run(name: str, target: Any, options: list[str]) -> bool:  # noqa: ANN401 - a Target, or None of one in C
    """Run one target in processes of its own, one after the other; tell how far it came."""
    place = BUILD / name
    place.mkdir(parents=True, exist_ok=True)
    program = native.built(name, BUILD) if target is None else None
    log = place.with_suffix(".log")
    count, seconds, sound = 0, 0.0, True
    for part in _parts(options):
        done, took = _run_part(name, target, program, part)
        count, seconds, sound = count + done, seconds + took, done > 0
        if not sound:
            break
    said = f"{count} executions, {count / max(seconds, 1e-3):.0f} per second"
    print(f"{name:>21}: {said}, {seconds:.0f} s{'' if sound else f'; broke off, see {log}'}", flush=True)
    return sound


def _parts(options: list[str]) -> list[list[str]]:
    """Return the options of each process; none runs long, as the engine keeps arrays that are compared."""
    given = {each.partition("=")[0]: each.partition("=")[2] for each in options}
    runs = int(given.pop("-runs", "0"))
    most = [min(_PART, runs - start) for start in range(0, runs, _PART)]
    seed = int(given.pop("-seed", "0"))
    others = [each for each in options if each.partition("=")[0] in given]
    return [
        [*others, f"-runs={n}", *([f"-seed={seed + k}"] if seed else [])] for k, n in enumerate(most)
    ] or [options]


def _run_part(name: str, target: Any, program: Path | None, options: list[str]) -> tuple[int, float]:  # noqa: ANN401 - a Target, or None of one in C
    """Return the executions in one process (0: it broke off) and the seconds of its processor, or of all."""
    place, log = BUILD / name, (BUILD / name).with_suffix(".log")
    sys.stdout.flush()
    with tempfile.TemporaryDirectory(prefix="mrdamper-fuzz-", dir=_MEMORY) as room:
        process = os.fork()
        if process == 0:
            tempfile.tempdir = room
            stream = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644)
            os.dup2(stream, 1)
            os.dup2(stream, 2)
            try:
                if program is not None:
                    _become(program, name, place, options)
                _fuzz(name, target, place, options)
            except BaseException:
                traceback.print_exc()
            ctypes.CDLL(None).exit(1)  # by the C library: the engine's handler keeps the input at fault
        _, status, used = os.wait4(process, 0)
    seconds = used.ru_utime + used.ru_stime
    lines = log.read_text(encoding="utf-8", errors="replace").splitlines()
    count = next((line.split()[1] for line in reversed(lines) if line.startswith("Done ")), "0")
    return int(count) if status == 0 else 0, seconds


def _become(program: Path, name: str, place: Path, options: list[str]) -> NoReturn:
    kept = Path(__file__).with_name("corpus") / name
    for k, seed in enumerate(native.seeds(name)):
        (place / f"seed-{k}").write_bytes(seed)
    inputs = [str(each) for each in (place, kept) if each.is_dir()]
    os.execv(program, [str(program), *_engine_options(place, native.LONGEST), *options, *inputs])


def _fuzz(name: str, target: Any, place: Path, options: list[str]) -> None:  # noqa: ANN401 - a Target
    import atheris

    for k, seed in enumerate(target.seeds()):
        (place / f"seed-{k}").write_bytes(seed)
    for path in sys.modules["fuzz.targets"].kept_inputs(name):
        shutil.copyfile(path, place / f"kept-{path.name}")
    atheris.Setup([sys.argv[0], *_engine_options(place, target.longest), *options, str(place)], target.take)
    atheris.Fuzz()


def _engine_options(place: Path, longest: int) -> list[str]:
    return [
        f"-max_len={longest}",
        f"-timeout={_SECONDS}",
        f"-rss_limit_mb={_MEGABYTES}",
        f"-artifact_prefix={place}.",
        "-print_final_stats=1",
    ]


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
