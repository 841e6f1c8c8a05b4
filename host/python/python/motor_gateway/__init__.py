"""Motors behind a motor gateway.

>>> from motor_gateway import FOUR_MOTORS, Simulator, make_velocity
>>> with Simulator().connect(FOUR_MOTORS) as gateway:
...     with gateway.arm(0) as motors:
...         motors.hold([make_velocity(0, 2.0)], 0.5)
...         [state] = motors.cycle([make_velocity(0, 2.0)])
...     print(state.state, round(state.velocity_rad_s))
active 2
"""

from ._native import (
    STATES,
    AxisSetpoint,
    CyclePeriod,
    CycleState,
    configuration_schema,
    make_current,
    make_impedance,
    make_position,
    make_signal,
    make_velocity,
)
from ._native import VERSION as __version__
from .arrays import as_array
from .asynchronous import AsyncArmed, AsyncGateway, AsyncRunningCycle, AsyncSamples
from .configuration import FOUR_MOTORS, Axis, Bus, Configuration, GatewaySettings
from .errors import (
    ClosedError,
    ConfigurationError,
    GatewayError,
    InterruptedCallError,
    LinkError,
    MotorGatewayError,
    StopUnansweredError,
    UsageError,
)
from .frames import decode, encode
from .gateway import (
    FAST_FIELDS,
    Armed,
    ConfigurationLike,
    Configured,
    Gateway,
    MoveTarget,
    RunningCycle,
    Samples,
    connect,
)
from .readings import AxisState, Event, Reading, Sample, Trip
from .simulator import Motor, Simulator

__all__ = [
    "FAST_FIELDS", "FOUR_MOTORS", "STATES", "Armed", "AsyncArmed", "AsyncGateway",
    "AsyncRunningCycle", "AsyncSamples", "Axis", "AxisSetpoint", "AxisState", "Bus",
    "ClosedError", "Configuration", "ConfigurationError", "ConfigurationLike", "Configured", "CyclePeriod",
    "CycleState", "Event", "Gateway", "GatewayError", "GatewaySettings", "InterruptedCallError",
    "LinkError", "Motor", "MotorGatewayError", "MoveTarget", "Reading", "RunningCycle", "Sample",
    "Samples", "Simulator", "StopUnansweredError", "Trip", "UsageError", "__version__", "as_array",
    "configuration_schema", "connect", "decode", "encode", "make_current", "make_impedance",
    "make_position", "make_signal", "make_velocity",
]
