"""The force map: force versus temperature, command and velocity, for vehicle simulators.

The force of a damper depends on the past motion, but a table does not. The force map therefore contains three
forces for each velocity. ``pick`` is the force that a dynamometer measures as peak-velocity pick: a sine has
this peak velocity, and the force is read at mid-stroke. There the hysteresis force is built up completely and
the acceleration is zero. ``rising`` and ``falling`` are read from the force-velocity loop of one fast sine,
where its velocity rises or falls through this velocity. All forces are computed by ``models.simulate`` at
constant command and temperature.
"""

from __future__ import annotations

import csv
import io
import math
from dataclasses import dataclass

import numpy as np

from mrdamper import __version__
from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.excitation import Sine, drive
from mrdamper.models.card import ModelCard
from mrdamper.models.card_schema import card_sha256
from mrdamper.models.characteristics import PERIOD_COUNT, peak_velocity_pick
from mrdamper.models.simulate import simulate
from mrdamper.quantities import REFERENCE_K, ZERO_CELSIUS_K

COMMAND_COUNT = 9
TEMPERATURE_STEP_K = 20.0


@dataclass(frozen=True, slots=True, eq=False)
class ForceMap:
    """Force [N] versus temperature, command and velocity. The three force arrays have shape (t, c, v)."""

    card: ModelCard
    amplitude: float  # amplitude of all sines [m]
    temperature: FloatArray  # [K], shape (t,)
    command: FloatArray  # [A or V], shape (c,)
    velocity: FloatArray  # [m/s], rising, shape (v,)
    pick: FloatArray  # force at mid-stroke of a sine whose peak velocity is the velocity in the table
    rising: FloatArray  # force while the velocity rises
    falling: FloatArray

    def as_csv(self) -> str:
        """Return the force map as CSV: comment lines, a header, and one row per grid point."""
        card, unit = self.card, self.card.damper.command_unit
        column = "current_A" if unit == "A" else "voltage_V"
        fastest = float(self.velocity[-1])
        stroke = f"amplitude {1e3 * self.amplitude:g} mm"
        text = io.StringIO()
        for line in (
            f"Force map of a magnetorheological damper, by mrdamper {__version__}",
            f"card {' '.join(card.title.split())}",
            f"fingerprint {card_sha256(card)}",
            f"law {card.damper.law.name}",
            "extension positive; a force that resists extension is positive; the command is constant",
            f"force_N: at mid-stroke of a steady sine ({stroke}) whose peak velocity is that of the row; "
            "settled hysteresis, no acceleration; at rest the mean of the slowest of either direction",
            f"force_rising_N, force_falling_N: the two branches of the loop of a steady sine, {stroke}, peak "
            f"velocity {fastest:g} m/s, where the row's velocity is passed upwards and downwards",
        ):
            text.write(f"# {line}\n")
        rows = csv.writer(text, lineterminator="\n")
        rows.writerow(
            ["temperature_degC", column, "velocity_m_s", "force_N", "force_rising_N", "force_falling_N"]
        )
        for i, kelvin in enumerate(self.temperature.tolist()):
            for j, command in enumerate(self.command.tolist()):
                for k, velocity in enumerate(self.velocity.tolist()):
                    forces = (self.pick[i, j, k], self.rising[i, j, k], self.falling[i, j, k])
                    place = (f"{kelvin - ZERO_CELSIUS_K:.6g}", f"{command:.9g}", f"{velocity:.9g}")
                    rows.writerow([*place, *(f"{force:.9g}" for force in forces)])
        return text.getvalue()


def force_map(card: ModelCard) -> ForceMap:
    """Return the force map of a model card, for commands and motions in its envelope.

    Raises
    ------
    InputError
        If the damper did not move in the runs, or the card has a user-defined hysteresis law.
    """
    speed_count = 12  # number of speeds in each direction; low speeds have a finer grid
    damper, envelope = card.damper, card.envelope
    amplitude, fastest = max(map(abs, envelope.displacement)), max(map(abs, envelope.velocity))
    if not (amplitude > 0.0 and fastest > 0.0):
        raise InputError(
            place="force map",
            found=f"the card's data cover {amplitude:g} m and {fastest:g} m/s",
            expected="a motion",
            remedy="Identify runs in which the damper moves",
        )
    shares = (np.arange(1, speed_count + 1) / speed_count) ** 1.5
    speeds = np.array([float(f"{fastest * share:.3g}") for share in shares[:-1]] + [fastest])
    commands = np.linspace(max(envelope.command[0], 0.0), envelope.command[1], COMMAND_COUNT)
    if np.ptp(commands) == 0.0:
        commands = commands[:1]
    warm = np.array([REFERENCE_K])
    if damper.temperature_dependent and envelope.temperature is not None:
        low, high = envelope.temperature
        warm = np.linspace(low, high, math.ceil((high - low) / TEMPERATURE_STEP_K) + 1)
    velocity = np.concatenate([-speeds[::-1], [0.0], speeds])
    shape = (len(warm), len(commands), len(velocity))
    pick, rising, falling = np.empty(shape), np.empty(shape), np.empty(shape)
    for i, kelvin in enumerate(warm.tolist()):
        for j, command in enumerate(commands.tolist()):
            curve = peak_velocity_pick(
                damper, speeds, amplitude=amplitude, command=command, temperature=kelvin
            )
            rest = 0.5 * (curve.extension[0] + curve.retraction[0])
            pick[i, j] = np.concatenate([curve.retraction[::-1], [rest], curve.extension])
            rising[i, j], falling[i, j] = _branches(card, amplitude, command, kelvin, velocity)
    return ForceMap(card, amplitude, warm, commands, velocity, pick, rising, falling)


def _branches(
    card: ModelCard, amplitude: float, command: float, kelvin: float, velocity: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the forces of a sine at each velocity, for rising and falling velocity."""
    loop_sample_count = 4000  # number of samples in one period of the sine
    fastest = float(velocity[-1])
    motion = Sine(amplitude, fastest / (2.0 * math.pi * amplitude))
    path = drive(
        motion,
        duration=PERIOD_COUNT * motion.period,
        rate_Hz=loop_sample_count * motion.frequency,
        command=command,
        temperature=kelvin,
    )
    force = simulate(card.damper, path)[-loop_sample_count - 1 :]
    v = path.velocity[-loop_sample_count - 1 :]
    half = loop_sample_count // 2
    upwards = np.interp(velocity, v[half:], force[half:])
    downwards = np.interp(velocity, v[half::-1], force[half::-1])
    return upwards, downwards
