import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]  # The extension accepts any contiguous buffer of C doubles.

PARAMETERS: dict[str, tuple[str, ...]]  # by kind of damper: lumped, hydraulic
STATE: dict[str, tuple[str, ...]]

class Plant:
    state: tuple[float, ...]
    def __new__(cls, kind: str, parameters: FloatArray, step: float, inner: int) -> Plant: ...
    def advance(self, displacement: float, velocity: float, current: float, kelvin: float, /) -> float: ...
    def run(
        self,
        displacement: FloatArray,
        velocity: FloatArray,
        current: float | FloatArray,
        kelvin: float | FloatArray,
        force: FloatArray,
        coil: FloatArray | None,
        field: FloatArray | None,
        /,
    ) -> None: ...
    def hold(self, kelvin: float, count: int, /) -> object: ...
    def copy(self) -> Plant: ...
