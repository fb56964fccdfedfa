from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]  # any contiguous buffer of C doubles will do; NumPy's is what we pass

class Record:
    def __new__(
        cls,
        step: float,
        displacement: FloatArray,
        velocity: FloatArray,
        acceleration: FloatArray,
        dead_band: float,
        longest_step: float,
    ) -> Record: ...
    @property
    def samples(self) -> int: ...
    @property
    def substeps(self) -> int: ...
    @property
    def pieces(self) -> tuple[tuple[int, float, int], ...]: ...

class Workspace: ...

def run(
    law: int,
    record: Record,
    coefficients: FloatArray,
    directions: Sequence[int],
    seeds: FloatArray | None,
    force: FloatArray | None,
    columns: FloatArray | None,
    workspace: Workspace | None,
    /,
) -> None: ...
def causal(law: int, record: Record, coefficients: FloatArray, force: FloatArray, /) -> None: ...
def squared_errors(
    law: int,
    records: Sequence[Record],
    measured: Sequence[FloatArray],
    starts: Sequence[int],
    coefficients: FloatArray,
    errors: FloatArray,
    /,
) -> None: ...
def gram(columns: FloatArray, rows: int, start: int, out: FloatArray, /) -> None: ...
def curve(
    kappa: float,
    n: float,
    tau: FloatArray,
    w: FloatArray,
    slope: FloatArray,
    by_kappa: FloatArray,
    by_n: FloatArray,
    /,
) -> None: ...
def lag(
    step: float, rise: float, fall: float, command: FloatArray, applied: FloatArray, by_lag: FloatArray, /
) -> None: ...
def levels() -> tuple[str, ...]: ...
def level() -> str: ...
def use_level(name: str, /) -> None: ...
