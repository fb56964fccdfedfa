"""A simulation master for FMUs in tests: FMPy with access to variables by their names."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import pytest

from mrdamper.codegen.c_code import c_files, sources_sha256
from mrdamper.codegen.fmu import write_fmu
from mrdamper.codegen.record import Verification
from mrdamper.codegen.target import Target
from mrdamper.control.controllers import ForceController
from mrdamper.control.protocol import Measurement, Reference

fmpy = pytest.importorskip("fmpy")
fmi2 = import_module("fmpy.fmi2")
FmiError = import_module("fmpy.fmi1").FMICallException


def passed_verification(target: Target) -> Verification:
    """Return the record of a passed verification of a target without running the verification."""
    sources = sources_sha256(c_files(target))
    return Verification(passed=True, sources_sha256=sources, precision=target.precision, samples=1)


def written(target: Target, path: Path) -> Path:
    """Write the FMU of a target without verification and return its path."""
    write_fmu(target, path, verification=passed_verification(target))
    return path


def table_of(**columns: Any) -> np.ndarray:
    """Return input columns as the structured array that FMPy requires. The first column is ``time``."""
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

    def slave(self, name: str = "one") -> Slave:
        """Return a new instance that is not yet initialised."""
        return Slave(self, name)


class Slave:
    """An instance of an FMU. ``messages`` is its log. The end of a ``with`` block frees the instance."""

    def __init__(self, library: Library, name: str, guid: str | None = None):
        self.library, self.messages = library, list[str]()
        self.fmu: Any = fmi2.FMU2Slave(
            guid=guid or library.description.guid,
            modelIdentifier=library.description.coSimulation.modelIdentifier,
            unzipDirectory=str(library.folder),
            instanceName=name,
        )
        self._callbacks = _callbacks(self.messages)
        self.fmu.instantiate(callbacks=self._callbacks)

    def __enter__(self) -> Slave:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Free the instance. The library of the FMU stays loaded."""
        self.fmu.fmi2FreeInstance(self.fmu.component)

    def get(self, *names: str) -> list[Any]:
        """Return the values of variables by name."""
        values = []
        for name in names:
            variable = self.library.variables[name]
            values += getattr(self.fmu, f"get{variable.type}")([variable.valueReference])
        return values

    def set(self, **values: float | bool) -> None:
        """Set variables to values by name."""
        for name, value in values.items():
            variable = self.library.variables[name]
            converted = int(value) if variable.type == "Integer" else value
            getattr(self.fmu, f"set{variable.type}")([variable.valueReference], [converted])

    def begin(self, start: float = 0.0) -> Slave:
        """Initialise the instance at time ``start`` [s]."""
        self.fmu.setupExperiment(startTime=start)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        return self

    def step(self, time: float, length: float) -> None:
        """Execute one communication step."""
        self.fmu.doStep(currentCommunicationPoint=time, communicationStepSize=length)

    def run(self, table: np.ndarray[Any, Any], outputs: tuple[str, ...], first: int = 0) -> Any:
        """Step through a table of inputs, one row per sample. Return outputs of shape (n, outputs)."""
        period = float(self.library.description.defaultExperiment.stepSize)
        rows = []
        for k, row in enumerate(table, start=first):
            self.set(**{name: float(row[name]) for name in table.dtype.names or () if name != "time"})
            self.step(k * period, period)
            rows.append(self.get(*outputs))
        return np.array(rows, dtype=np.float64)


def _callbacks(messages: list[str]) -> Any:
    """Return the callback functions of FMI 2.0 with a logger that appends messages to a list."""
    callbacks = fmi2.fmi2CallbackFunctions()
    callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(
        lambda _, name, status, category, text: messages.append(text.decode())
    )
    callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
    callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
    return callbacks


@dataclass(frozen=True)
class FmuController:
    """A controller for the simulated loop whose commands and states are computed by an FMU."""

    slave: Slave
    like: ForceController  # The controller that the FMU replaces

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

    def start(self) -> Any:
        self.slave.fmu.reset()
        self.slave.begin()
        self.slave.set(use_wanted_force_ahead=True)
        return self.slave.fmu.getFMUState()

    def step(self, state: Any, wanted: Reference, seen: Measurement) -> tuple[Any, float]:
        slave = self.slave
        slave.fmu.setFMUState(state)
        slave.fmu.freeFMUState(state)
        assert wanted.ahead is not None
        slave.set(
            wanted_force=wanted.now,
            wanted_force_ahead=wanted.ahead,
            displacement=seen.displacement,
            temperature=seen.temperature,
        )
        slave.step(slave.get("time")[0], self.period_s)
        return slave.fmu.getFMUState(), float(slave.get("current")[0])
