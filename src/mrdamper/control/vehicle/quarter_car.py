"""A card's damper in a quarter car: the controlled ride between the ideal one and passive settings.

The damper is the card's own real-time model, the controller is made from the same card: what is left is what
controller, lags and thermometer cost, not what the card does not know of the damper.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from mrdamper.control.controllers import check_name, controllers_for, names_for
from mrdamper.control.realtime import RealtimeDamper, realtime_model
from mrdamper.control.vehicle.car import Demand, QuarterCar, demand_named
from mrdamper.control.vehicle.drive import Ride, RoadSegment, Vehicle, drive_car
from mrdamper.control.vehicle.long_drive import Journey, LongDrive, drive_long
from mrdamper.control.vehicle.mount import TopMount
from mrdamper.control.vehicle.observer import VehicleSensors
from mrdamper.control.vehicle.roads import OBSTACLES, Heights, Obstacle, Profile, ProfileAtSpeed
from mrdamper.excitation import Road
from mrdamper.models.card import ModelCard
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.runtime.progress import Progress, ProgressUpdate, silent
from mrdamper.schema import unknown_name

_STEP_S = 0.25e-3  # of the damper's model, a quarter of the controller's period
_UNAWARE_degC = 20.0  # what a controller that does not know temperature takes for it
_STROKE_NOISE_M = RoadSegment().displacement_noise_m
_SETTINGS = (0.5, 1.0)  # of the largest current, held
FASTEST_M_S = 4.0  # speed up to which the tables reach: a car's damper is faster than a rig's


@dataclass(frozen=True, slots=True, kw_only=True)
class QuarterCarOptions:
    """What is driven, and by whom.

    Raises
    ------
    InputError
        A demand that there is not; a segment without anything to score; a road or a car that cannot be.
    """

    car: QuarterCar = field(default_factory=QuarterCar)
    mount: TopMount | None = None  # between the damper's rod and the body
    demand: str = "linear-quadratic"
    damping_N_s_m: float = 2500.0  # of every demand but the regulator's
    sensors: VehicleSensors | None = None  # that tell the demand the car's states; None: it knows them
    controller: str = "recommended"
    road_class: str = "C"  # ISO 8608, A (smooth) to H, or an obstacle's kind
    obstacle_height_m: float = 0.06  # of a pothole its depth
    obstacle_length_m: float = 2.0
    profile: Profile | None = None  # a recorded road, in place of these
    speed_m_s: float = 20.0
    duration_s: float = 20.0
    unscored_s: float = 2.0
    temperature_degC: float = 20.0  # of fluid and coil, held
    thermometer_degC: float | None = None  # what the controller's thermometer shows; None: the same
    seed: int = 5  # of road and sensors
    long_drive: LongDrive | None = None  # the damper warms over this, after the ride

    def __post_init__(self) -> None:
        self.demanded()
        self.segment()

    def segment(self) -> RoadSegment:
        """Return the road to drive on."""
        return RoadSegment(
            road=self.road(),
            duration_s=self.duration_s,
            unscored_s=self.unscored_s,
            temperature_degC=self.temperature_degC,
            thermometer_degC=self.thermometer_degC,
            seed=self.seed,
        )

    def demanded(self) -> Demand:
        """Return the force that is asked for."""
        return demand_named(self.demand, self.car, self.damping_N_s_m)

    def road(self) -> Heights:
        """Return what the wheel rolls over."""
        if self.profile is not None:
            return ProfileAtSpeed(self.profile, self.speed_m_s)
        for kind in OBSTACLES:
            if kind == self.road_class:
                height, length = self.obstacle_height_m, self.obstacle_length_m
                return Obstacle(kind=kind, height_m=height, length_m=length, speed_m_s=self.speed_m_s)
        return Road(self.road_class, self.speed_m_s, self.seed)


@dataclass(frozen=True, slots=True, eq=False)
class QuarterCarRides:
    """One road, driven by each, and the long drives if one was asked for."""

    controlled: Ride
    true_states: Ride | None  # the same with true states; None: it has them anyway
    unaware: Ride | None  # the same controller with a thermometer that shows 20 degC; None: it is right
    ideal: Ride  # the demand itself acts
    passive: Ride  # no current
    settings: tuple[tuple[float, Ride], ...]  # held currents [A] and their rides
    journey: Journey | None  # of the controlled car
    passive_journey: Journey | None
    preview_s: float  # of the controller


@dataclass(slots=True, eq=False)
class RealtimeCarDamper:
    """The real-time model of a card as a car's damper; it remembers, as every ``CarDamper``."""

    model: RealtimeDamper
    state: bytes

    @property
    def step_s(self) -> float:
        """Time between two steps [s]."""
        return self.model.period_s

    def advance(
        self, displacement: float, velocity: float, current: float, temperature_degC: float, /
    ) -> float:
        """Move on by one step; return the force [N] at its end."""
        kelvin = temperature_degC + ZERO_CELSIUS_K
        self.state, force = self.model.step(self.state, displacement, velocity, current, kelvin)
        return force

    def copy(self) -> RealtimeCarDamper:
        """Return a damper in the same state, which goes its own way from here."""
        return replace(self)


def drive_quarter_car(
    card: ModelCard, options: QuarterCarOptions | None = None, *, on_progress: Progress = silent
) -> QuarterCarRides:
    """Drive a road with the controlled damper of a card, with the ideal one, without current and at settings.

    Raises
    ------
    InputError
        A law without a real-time form, a controller that there is not, a card whose largest command is not
        known, a car that is not held: its travel leaves +-1 m.
    """
    asked = options or QuarterCarOptions()
    law = card.damper.law.name
    check_name(asked.controller, law)
    if asked.controller not in names_for(law):
        raise unknown_name(f"there is no controller {asked.controller!r}", asked.controller, names_for(law))
    noise = _STROKE_NOISE_M if asked.sensors is None else asked.sensors.stroke_noise_m
    controllers = controllers_for(card, displacement_noise_m=noise, speed_m_s=FASTEST_M_S)
    controller = controllers[asked.controller]
    model = realtime_model(card, period_s=_STEP_S, speed_m_s=FASTEST_M_S)
    ideal = Vehicle(asked.car, asked.demanded())
    damper = RealtimeCarDamper(model, model.start())
    passive = replace(ideal, damper=damper, highest_A=controller.largest, mount=asked.mount)
    known = replace(passive, controller=controller)
    segment = replace(asked.segment(), displacement_noise_m=noise)
    controlled = replace(known, sensors=asked.sensors)
    plan, done = asked.long_drive, 0
    hidden = abs(asked.temperature_degC - _UNAWARE_degC) > 1.0

    def begin(text: str) -> None:
        nonlocal done
        total = 3 + len(_SETTINGS) + hidden + (asked.sensors is not None) + (0 if plan is None else 2)
        on_progress(ProgressUpdate(done=done, total=total, text=text))
        done += 1

    def ride(name: str, vehicle: Vehicle, road: RoadSegment = segment) -> Ride:
        begin(f"the {name} car")
        return drive_car(vehicle, road)

    def held(share: float) -> tuple[float, Ride]:
        current = share * controller.largest
        return current, ride(f"passive car at {current:g} A", replace(passive, held_A=current))

    def journey(name: str, vehicle: Vehicle) -> Journey | None:
        if plan is None:
            return None
        begin(f"the {name} car's damper warms")
        return drive_long(vehicle, plan, segment)

    return QuarterCarRides(
        controlled=ride("controlled", controlled),
        true_states=None if asked.sensors is None else ride("controlled, with true states,", known),
        unaware=ride("unaware", controlled, replace(segment, thermometer_degC=_UNAWARE_degC))
        if hidden
        else None,
        ideal=ride("ideal", ideal),
        passive=ride("passive", passive),
        settings=tuple(map(held, _SETTINGS)),
        journey=journey("controlled", controlled),
        passive_journey=journey("passive", passive),
        preview_s=controller.preview_s,
    )
