from collections.abc import Sequence

from typing_extensions import Buffer

class Record:
    def __new__(
        cls,
        step: float,
        displacement: Buffer,
        velocity: Buffer,
        acceleration: Buffer,
        dead_band: float,
        longest_step: float,
    ) -> Record: ...
    @property
    def samples(self) -> int: ...
    @property
    def substeps(self) -> int: ...
    @property
    def pieces(self) -> tuple[tuple[int, float, int], ...]: ...

def run(
    law: int,
    record: Record,
    coefficients: Buffer,
    directions: Sequence[int],
    seeds: Buffer | None,
    force: Buffer | None,
    columns: Buffer | None,
    /,
) -> None: ...
def causal(law: int, record: Record, coefficients: Buffer, force: Buffer, /) -> None: ...
def squared_errors(
    law: int,
    records: Sequence[Record],
    measured: Sequence[Buffer],
    starts: Sequence[int],
    coefficients: Buffer,
    errors: Buffer,
    /,
) -> None: ...
def gram(columns: Buffer, rows: int, start: int, out: Buffer, /) -> None: ...
def curve(
    kappa: float, n: float, tau: Buffer, w: Buffer, slope: Buffer, by_kappa: Buffer, by_n: Buffer, /
) -> None: ...
def lag(step: float, lag: float, command: Buffer, applied: Buffer, by_lag: Buffer, /) -> None: ...
def levels() -> tuple[str, ...]: ...
def level() -> str: ...
def use_level(name: str, /) -> None: ...
