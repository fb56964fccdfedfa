"""What a wheel rolls over beside the roads of ISO 8608: a single obstacle, or a recorded profile."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol, get_args

import numpy as np
from numpy.typing import ArrayLike

from mrdamper.arrays import FloatArray, read_only
from mrdamper.data.tables import read_table
from mrdamper.errors import InputError

ObstacleKind = Literal["bump", "pothole", "step"]
OBSTACLES: tuple[ObstacleKind, ...] = get_args(ObstacleKind)

_START_s = 2.5  # of an obstacle: the score begins a moment before
_COLUMNS = ("distance_m", "height_m")


class Heights(Protocol):
    """A road as a drive needs it: a value that can be hashed, and its height."""

    def __hash__(self) -> int: ...
    def displacement(self, t: ArrayLike, /) -> FloatArray:
        """Return the height under the wheel [m] at times [s], shape (n,)."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Obstacle:
    """A flat road with one obstacle, at constant speed.

    A bump and a pothole are a whole wave of a raised cosine; a step is half of one, and stays up.
    """

    kind: ObstacleKind
    height_m: float  # of a pothole its depth
    length_m: float
    speed_m_s: float
    start_s: float = _START_s

    def __post_init__(self) -> None:
        if self.kind not in OBSTACLES:
            raise InputError(found=f"obstacle is {self.kind!r}", expected=f"one of: {', '.join(OBSTACLES)}")
        for name in ("height_m", "length_m", "speed_m_s"):
            if not 0.0 < getattr(self, name) < np.inf:
                found = f"{name} is {getattr(self, name):g}"
                raise InputError(place=self.kind, found=found, expected="a positive number")

    def displacement(self, t: ArrayLike, /) -> FloatArray:
        share = np.clip((np.asarray(t) - self.start_s) * self.speed_m_s / self.length_m, 0.0, 1.0)
        size = -self.height_m if self.kind == "pothole" else self.height_m
        waves = 0.5 if self.kind == "step" else 1.0
        return np.asarray(size * 0.5 * (1.0 - np.cos(2.0 * np.pi * waves * share)))


@dataclass(frozen=True, slots=True, eq=False)
class Profile:
    """A recorded road: heights over distance, from zero on; arrays are read-only, distance rises."""

    distance: FloatArray  # [m], shape (n,)
    height: FloatArray  # [m]
    name: str = "profile"

    def __post_init__(self) -> None:
        distance, height = (np.asarray(each, dtype=np.float64) for each in (self.distance, self.height))
        if not (distance.shape == height.shape and distance.ndim == 1 and len(distance) > 1):
            raise InputError(
                place=self.name,
                found=f"{distance.size} distances and {height.size} heights",
                expected="two or more of each",
            )
        if not np.isfinite([distance, height]).all():
            raise InputError(place=self.name, found="a value that is no number", expected="metres")
        falls = np.flatnonzero(np.diff(distance) <= 0.0)
        if len(falls):
            raise InputError(
                place=self.name,
                found=f"distance does not rise after {distance[falls[0]]:g} m",
                expected="metres in order, none twice",
            )
        object.__setattr__(self, "distance", read_only(distance - distance[0]))
        object.__setattr__(self, "height", read_only(height - height[0]))


@dataclass(frozen=True, slots=True)
class ProfileAtSpeed:
    """A recorded road at constant speed, straight between its points; driven back and forth where it ends."""

    profile: Profile
    speed_m_s: float

    def displacement(self, t: ArrayLike, /) -> FloatArray:
        length = float(self.profile.distance[-1])
        gone = np.mod(np.asarray(t) * self.speed_m_s, 2.0 * length)
        back = np.where(gone > length, 2.0 * length - gone, gone)
        return np.interp(back, self.profile.distance, self.profile.height)


def read_profile(path: str | Path) -> Profile:
    """Read a recorded road from a table with the columns distance_m and height_m.

    Raises
    ------
    InputError
        A file that cannot be read, lacks a column, or holds no rising distance.
    """
    place = Path(path)
    table = read_table(place)
    missing = [name for name in _COLUMNS if name not in table.columns]
    if missing:
        raise InputError(
            place=place.name,
            found=f"no column {' and no column '.join(missing)} (columns: {', '.join(table.names)})",
            expected=f"the columns {' and '.join(_COLUMNS)}",
        )
    distance, height = (table.columns[name] for name in _COLUMNS)
    return Profile(distance, height, place.name)
