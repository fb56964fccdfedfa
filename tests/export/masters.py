"""A master for the FMUs of the tests: FMPy behind names, the same for FMI 2.0 and 3.0."""

from __future__ import annotations

import resource
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import pytest

from mrdamper.codegen.c_code import c_files, sources_sha256
from mrdamper.codegen.fmu import FmiVersion, write_fmu
from mrdamper.codegen.record import Verification
from mrdamper.codegen.target import Target
from mrdamper.control.controllers import ForceController
from mrdamper.control.protocol import Measurement, Reference

fmpy = pytest.importorskip("fmpy")
fmi2, fmi3 = import_module("fmpy.fmi2"), import_module("fmpy.fmi3")
FmiRefusal = import_module("fmpy.fmi1").FMICallException


def believed(target: Target) -> Verification:
    """Return a record as of a passed check: the check itself is tested elsewhere."""
    sources = sources_sha256(c_files(target))
    return Verification(passed=True, sources_sha256=sources, precision=target.precision, samples=1)


def written(target: Target, path: Path, version: FmiVersion) -> Path:
    """Write an FMU, its sources taken for verified; return its path."""
    write_fmu(target, path, version=version, verification=believed(target))
    return path


def table_of(**columns: Any) -> np.ndarray:
    """Return columns of inputs, the first of them ``time``, as the table that a master takes."""
    table = np.zeros(len(columns["time"]), dtype=[(name, float) for name in columns])
    for name, column in columns.items():
        table[name] = column
    return table


class Library:
    """An FMU that is unpacked and loaded."""

    def __init__(self, path: Path, folder: Path):
        self.folder = Path(fmpy.extract(str(path), unzipdir=str(folder)))
        self.description = fmpy.read_model_description(str(self.folder))
        self.variables = {each.name: each for each in self.description.modelVariables}
        self.is_2 = self.description.fmiVersion == "2.0"

    def slave(self, name: str = "one") -> Slave:
        """Return a new instance, instantiated and no further."""
        return Slave(self, name)


class Slave:
    """An instance; ``said`` is what it logged. Used in a with-block, it is freed at the end."""

    def __init__(self, library: Library, name: str, guid: str | None = None):
        self.library, self.said = library, list[str]()
        kind = fmi2.FMU2Slave if library.is_2 else fmi3.FMU3Slave
        self.fmu: Any = kind(
            guid=guid or library.description.guid,
            modelIdentifier=library.description.coSimulation.modelIdentifier,
            unzipDirectory=str(library.folder),
            instanceName=name,
        )
        if library.is_2:
            self._callbacks = _callbacks(self.said)
            self.fmu.instantiate(callbacks=self._callbacks)
        else:
            self.fmu.instantiate(logMessage=lambda _, status, category, text: self.said.append(text.decode()))

    def __enter__(self) -> Slave:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.free()

    def free(self) -> None:
        """Free the instance; the library stays loaded."""
        free = self.fmu.fmi2FreeInstance if self.library.is_2 else self.fmu.fmi3FreeInstance
        free(self.fmu.component)

    def get(self, *names: str) -> list[Any]:
        """Return values by name."""
        found = []
        for name in names:
            variable = self.library.variables[name]
            found += getattr(self.fmu, f"get{variable.type}")([variable.valueReference])
        return found

    def set(self, **values: float | bool) -> None:
        for name, value in values.items():
            variable = self.library.variables[name]
            told = int(value) if variable.type in {"Integer", "Int32"} else value
            getattr(self.fmu, f"set{variable.type}")([variable.valueReference], [told])

    def begin(self, start: float = 0.0) -> Slave:
        """Go through initialisation."""
        if self.library.is_2:
            self.fmu.setupExperiment(startTime=start)
            self.fmu.enterInitializationMode()
        else:
            self.fmu.enterInitializationMode(startTime=start)
        self.fmu.exitInitializationMode()
        return self

    def step(self, time: float, length: float) -> None:
        self.fmu.doStep(currentCommunicationPoint=time, communicationStepSize=length)

    def run(self, table: np.ndarray[Any, Any], outputs: tuple[str, ...], first: int = 0) -> Any:
        """Step through a table of inputs, a row per sample; return the outputs, shape (n, outputs)."""
        period = float(self.library.description.defaultExperiment.stepSize)
        found = []
        for k, row in enumerate(table, start=first):
            self.set(**{name: float(row[name]) for name in table.dtype.names or () if name != "time"})
            self.step(k * period, period)
            found.append(self.get(*outputs))
        return np.array(found, dtype=np.float64)

    def state(self) -> bytes:
        """Return the state, serialised."""
        held = self.fmu.getFMUState()
        try:
            return bytes(self.fmu.serializeFMUState(held))
        finally:
            self.fmu.freeFMUState(held)

    def restore(self, state: bytes) -> None:
        held = self.fmu.deserializeFMUState(state)
        try:
            self.fmu.setFMUState(held)
        finally:
            self.fmu.freeFMUState(held)


def _callbacks(said: list[str]) -> Any:
    """Return FMI 2.0's callbacks with a logger that writes down."""
    found = fmi2.fmi2CallbackFunctions()
    found.logger = fmi2.fmi2CallbackLoggerTYPE(
        lambda _, name, status, category, text: said.append(text.decode())
    )
    found.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
    found.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
    return found


@dataclass(frozen=True)
class FmuController:
    """A controller FMU in the tracking loop: its serialised state is the loop's, so a step is a function."""

    slave: Slave
    like: ForceController  # whose place it takes

    @property
    def name(self) -> str:
        return self.like.name

    @property
    def period_s(self) -> float:
        return float(self.slave.get("sample_time")[0])

    @property
    def preview_s(self) -> float:
        return float(self.slave.get("preview_time")[0])

    @property
    def needs_force(self) -> bool:
        return self.like.needs_force

    def start(self) -> bytes:
        self.slave.fmu.reset()
        self.slave.begin()
        self.slave.set(use_wanted_force_ahead=True)
        return self.slave.state()

    def step(self, state: bytes, wanted: Reference, seen: Measurement) -> tuple[bytes, float]:
        slave = self.slave
        slave.restore(state)
        assert wanted.ahead is not None
        slave.set(
            wanted_force=wanted.now,
            wanted_force_ahead=wanted.ahead,
            displacement=seen.displacement,
            temperature=seen.temperature,
        )
        slave.step(slave.get("time")[0], self.period_s)
        return slave.state(), float(slave.get("current")[0])


def resident_bytes() -> int:
    """Return the memory that this process holds."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize()
