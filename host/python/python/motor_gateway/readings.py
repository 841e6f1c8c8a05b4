"""What a gateway tells of its axes."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any, Dict, List, Mapping, Optional


@dataclass(frozen=True)
class Reading:
    """A measured value, in the unit that the name of its field says, and its age."""

    value: float
    age_us: int


@dataclass(frozen=True)
class Trip:
    """Why and when an axis tripped, and the last values before it."""

    reason: str
    time_us: int
    unreachable: bool
    velocity_rad_s: Optional[float]
    position_rad: Optional[float]
    current_a: Optional[float]
    #: What belongs to the reason: the limit that was exceeded, the names of the faults.
    more: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class AxisState:
    """How an axis is. What has not been measured is None."""

    axis: int
    #: One of :data:`motor_gateway.STATES`.
    state: str
    #: Of a tripped axis: whether its motor has confirmed the stop.
    stop_confirmed: Optional[bool]
    trip: Optional[Trip]
    position_rad: Optional[Reading]
    velocity_rad_s: Optional[Reading]
    current_a: Optional[Reading]
    voltage_v: Optional[Reading]
    motor_temperature_c: Optional[Reading]
    driver_temperature_c: Optional[Reading]
    #: The names of the faults in the manual of the motor, and its own word.
    faults: Optional[List[str]]
    faults_raw: Optional[int]
    #: Everything else that ``mgw state --json`` prints.
    more: Mapping[str, Any] = field(default_factory=dict)

    @property
    def is_armed(self) -> bool:
        """Whether it may move."""
        return self.state in ("armed", "active")

    @property
    def is_stopping(self) -> bool:
        """Whether its stop is not confirmed yet."""
        return self.state == "stopping" or (self.state == "tripped" and not self.stop_confirmed)


@dataclass(frozen=True)
class Sample(AxisState):
    """How an axis was at a gateway time, by subscription."""

    time_us: int = 0
    #: Events that were lost since the one before.
    dropped: int = 0


@dataclass(frozen=True)
class Event:
    """What the gateway says without being asked."""

    #: As in PROTOCOL.md, in snake_case: ``tripped``, ``state_changed``, …
    name: str
    #: Gateway time.
    time_us: int
    #: Events that were lost since the one before.
    dropped: int
    #: Its fields, as ``mgw watch --json`` prints them.
    fields: Mapping[str, Any]

    @property
    def axis(self) -> Optional[int]:
        """The axis that it is about, if it is about one."""
        axis: Optional[int] = self.fields.get("axis")
        return axis


_READINGS = ("position_rad", "velocity_rad_s", "current_a", "voltage_v", "motor_temperature_c",
             "driver_temperature_c")


def _split(kind: Any, told: Dict[str, Any]) -> Dict[str, Any]:
    names = {one.name for one in fields(kind)} - {"more"}
    more = {name: value for name, value in told.items() if name not in names}
    return {**{name: told.get(name) for name in names}, "more": more}


def trip_of(told: Optional[Dict[str, Any]]) -> Optional[Trip]:
    """The trip in what the gateway tells."""
    return None if told is None else Trip(**_split(Trip, told))


def _axis(kind: Any, told: Dict[str, Any]) -> Any:
    parts = _split(kind, told)
    for name in _READINGS:
        reading = parts[name]
        parts[name] = None if reading is None else Reading(reading["value"], reading["age_us"])
    parts["trip"] = trip_of(parts["trip"])
    return kind(**parts)


def axis_state(told: Dict[str, Any]) -> AxisState:
    """The state of an axis in what the gateway tells."""
    state: AxisState = _axis(AxisState, told)
    return state


def sample(event: Event) -> Sample:
    """The sample in an event."""
    told = {**event.fields, "time_us": event.time_us, "dropped": event.dropped}
    one: Sample = _axis(Sample, told)
    return one


def event_of(told: Dict[str, Any]) -> Event:
    """An event in what the gateway tells."""
    rest = dict(told)
    return Event(rest.pop("event"), rest.pop("time_us"), rest.pop("dropped"), rest)
