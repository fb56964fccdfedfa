"""The job ``ride``: a card's damper in a quarter car on a road, with its controller and without current.

With estimated states the same car rides on its true ones as well, for what they cost.

Comfort, road holding and rattle space of one scored ride, and the temperatures of a long one, side by side:
controlled, by a controller that takes the damper for cold, passive at no current and at settings of it;
between them stands the ideal damper, which gives the demand itself (``control.vehicle``). The damper is the
card's own model: what a ride shows is what controller, lags and temperature cost.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mrdamper.control.vehicle.drive import Ride
from mrdamper.control.vehicle.long_drive import Journey, LongDrive, TwoBodies
from mrdamper.control.vehicle.quarter_car import QuarterCarOptions, QuarterCarRides, drive_quarter_car
from mrdamper.control.vehicle.roads import Profile
from mrdamper.errors import InputError, option
from mrdamper.identify.predict import beyond_envelope
from mrdamper.jobs.options import RideOptions
from mrdamper.jobs.vehicle import OF_SENSORS, car_of, mount_of, refuse_idle, sensors_of
from mrdamper.models.card import ModelCard
from mrdamper.notes import Note
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.runtime.progress import Progress, silent

_USUAL = RideOptions()
_UNSCORED_S = 2.0
_EVERY_S, _SEGMENT_S = 60.0, 3.0  # of each minute of the long drive so much is driven
_HOTTEST_DEGC = 150.0  # where the long drive holds the damper


@dataclass(frozen=True, slots=True, eq=False)
class RideResult:
    """A road driven by the controlled, the passive and the ideal car; ``notes`` say what to beware of."""

    title: str  # of the card
    options: RideOptions
    rides: QuarterCarRides
    notes: tuple[str, ...]
    profile: str = ""  # name of the recorded road, where there was one

    @property
    def cars(self) -> tuple[tuple[str, Ride], ...]:
        """The scored rides by name, the passive car first."""
        unaware, known = self.rides.unaware, self.rides.true_states
        return (
            ("passive", self.rides.passive),
            *((f"passive, {current:g} A", each) for current, each in self.rides.settings),
            *(() if unaware is None else (("unaware", unaware),)),
            *(() if known is None else (("true states", known),)),
            ("controlled", self.rides.controlled),
            ("ideal", self.rides.ideal),
        )


def ride(
    card: ModelCard,
    options: RideOptions = _USUAL,
    *,
    profile: Profile | None = None,
    on_progress: Progress = silent,
) -> RideResult:
    """Return how a quarter car rides on a card's damper; a ``profile`` takes the place of the road's class.

    Raises
    ------
    UsageError
        Sensors that nothing reads, damping of a mount that is not there.
    InputError
        A card whose command is a voltage, a law without a real-time form, a controller that there is not, a
        car that is not held.
    """
    if options.states == "true":
        refuse_idle(options, OF_SENSORS, option("states", "estimated"))
    if options.mount_N_m is None:
        refuse_idle(options, ["mount_damping_N_s_m"], option("mount-N-m"))
    if card.damper.command_unit != "A":
        raise InputError(
            place=card.title,
            found="the card's command is a voltage, and the coil's heat goes by its current",
            expected="a card whose command is a current",
        )
    rides = drive_quarter_car(card, _asked(options, profile), on_progress=on_progress)
    journeys = [each for each in (rides.journey, rides.passive_journey) if each is not None]
    notes = beyond_envelope(card, {"these rides": _spans([rides.passive, rides.controlled], journeys)})
    if any(journey.fluid_degC.max() >= _HOTTEST_DEGC for journey in journeys):
        form = "the fluid is held at {degC:g} degC, which no damper does by itself"
        notes.append(Note("fluid_held", form, degC=_HOTTEST_DEGC))
    return RideResult(card.title, options, rides, tuple(notes), "" if profile is None else profile.name)


def _asked(options: RideOptions, profile: Profile | None) -> QuarterCarOptions:
    plan = None
    if options.warm_up_s > 0.0:
        every = min(_EVERY_S, options.warm_up_s)
        plan = LongDrive(
            duration_s=options.warm_up_s,
            every_s=every,
            segment_s=min(_SEGMENT_S, every),
            bodies=TwoBodies(housing_J_K=options.housing_J_K, ambient_W_K=options.cooling_W_K),
            ambient_degC=options.ambient_degC,
            hottest_degC=_HOTTEST_DEGC,
            coil_ohm=options.coil_resistance_ohm,
        )
    return QuarterCarOptions(
        car=car_of(options),
        mount=mount_of(options, options.mount_damping_N_s_m),
        sensors=sensors_of(options) if options.states == "estimated" else None,
        demand=options.demand,
        damping_N_s_m=options.damping_N_s_m,
        controller=options.controller,
        road_class=options.road_class,
        obstacle_height_m=options.obstacle_height_m,
        obstacle_length_m=options.obstacle_length_m,
        profile=profile,
        speed_m_s=options.speed_m_s,
        duration_s=options.duration_s,
        unscored_s=_UNSCORED_S,
        temperature_degC=options.temperature_degC,
        seed=options.seed,
        long_drive=plan,
    )


def _spans(rides: Sequence[Ride], journeys: Sequence[Journey]) -> dict[str, tuple[float, float]]:
    """Return least and most of what dampers went through: displacement [m], velocity [m/s], fluid [K]."""
    strokes = [ride.stroke for ride in rides]
    speeds = [np.diff(ride.stroke) / ride.step_s for ride in rides]
    tracks = {"displacement": np.concatenate(strokes), "velocity": np.concatenate(speeds)}
    if journeys:
        celsius = np.concatenate([journey.fluid_degC for journey in journeys])
        tracks["temperature"] = celsius + ZERO_CELSIUS_K
    return {name: (float(track.min()), float(track.max())) for name, track in tracks.items()}
