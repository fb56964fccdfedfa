from collections.abc import Sequence
from typing import TypedDict

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
    def behind(self) -> int: ...
    @property
    def substeps(self) -> int: ...
    @property
    def pieces(self) -> tuple[tuple[int, float, int], ...]: ...

class Workspace: ...

MOTION_NUMBERS: int
TURNS_NUMBERS: int
STATE_NUMBERS: int

class Belief(TypedDict):
    motion: tuple[float, float, float]
    applied: float
    command: float
    temperature: float
    disturbance: float
    parts: tuple[float, float, float, float]
    warmed: float
    flags: int

# yield force, chain, powers (exponent, least, top, bits, scale, cells), functions of a size
SeriesTables = tuple[
    FloatArray,
    FloatArray,
    Sequence[tuple[float, float, float, int, FloatArray, FloatArray]],
    Sequence[tuple[float, float, int, FloatArray]],
]

class Tracker:
    def __new__(
        cls,
        config: object,
        rows: bytes,
        current: FloatArray,
        factor: FloatArray,
        column: FloatArray,
        lookups: Sequence[tuple[float, float, int, FloatArray]],
        single: bool = False,
        series: SeriesTables | None = None,
    ) -> Tracker: ...
    def start(self) -> bytes: ...
    def step(
        self,
        state: bytes,
        now: float,
        ahead: float | None,
        displacement: float,
        temperature: float,
        force: float | None,
        /,
    ) -> tuple[bytes, float]: ...
    def run(self, state: bytes, inputs: FloatArray, current: FloatArray, flags: FloatArray, /) -> bytes: ...
    def model(
        self,
        state: bytes,
        displacement: float | None,
        velocity: float | None,
        current: float | None,
        temperature: float | None,
        /,
    ) -> tuple[bytes, float]: ...
    def simulate(
        self, state: bytes, inputs: FloatArray, force: FloatArray, flags: FloatArray, /
    ) -> bytes: ...
    def read(self, state: bytes, /) -> Belief: ...

def follow(
    plant: object,  # a capsule, of as many dampers in C as there are loops
    displacement: FloatArray,
    velocity: FloatArray,
    # tracker; its state; plant steps per sample, samples and steps by which commands come late, whether the
    # force is read, gain of the force, highest current, steps of the driver's and the force's converters;
    # sensed and frozen; force and commands, to be filled
    loops: tuple[
        tuple[
            Tracker,
            bytes,
            tuple[int, int, int, bool, float, float, float, float, float],
            FloatArray,
            FloatArray,
            FloatArray,
            FloatArray,
        ],
        ...,
    ],
    /,
) -> bool: ...
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
def gram_sums(
    law: int,
    records: Sequence[Record],
    measured: Sequence[FloatArray],
    starts: Sequence[int],
    coefficients: FloatArray,
    places: Sequence[int],
    out: FloatArray,
    residuals: FloatArray | None,
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
def batch(
    step: float,
    displacement: FloatArray,
    velocity: FloatArray,
    acceleration: FloatArray,
    dead_band: float,
    longest_step: float,
    patience: int,
    last: bool,
    motion: FloatArray,
    /,
) -> Record: ...
def carry(
    law: int,
    record: Record,
    coefficients: FloatArray,
    state: FloatArray,
    force: FloatArray,
    workspace: Workspace,
    /,
) -> None: ...
def lag(
    step: float,
    rise: float,
    fall: float,
    wheel: float,
    saturation: float,
    command: FloatArray,
    applied: FloatArray,
    by_lag: FloatArray,
    before: tuple[float, float] | None,
    /,
) -> None: ...
def banded(lower: FloatArray, right: FloatArray, /) -> None: ...
def turns(state: FloatArray, displacement: FloatArray, dead_band: float, at: FloatArray, /) -> int: ...
def levels() -> tuple[str, ...]: ...
def level() -> str: ...
def use_level(name: str, /) -> None: ...
