"""A session with a gateway, and the axes that are armed in it."""

from __future__ import annotations

import atexit
import json
import math
import os
import sys
import warnings
import weakref
from collections import deque
from pathlib import Path
from types import TracebackType
from typing import (
    Any,
    Deque,
    Dict,
    Iterator,
    List,
    Mapping,
    NamedTuple,
    Optional,
    Sequence,
    Tuple,
    Type,
    Union,
)

from . import _native
from ._native import AxisSetpoint, CyclePeriod, CycleState
from .configuration import Configuration
from .errors import LinkError, MotorGatewayError, UsageError
from .frames import FieldValue, field_words
from .readings import AxisState, Event, Sample, axis_state, event_of, sample

#: What a cycle tells of every axis unless it is asked for more.
FAST_FIELDS = ("position", "velocity", "current")
#: Events and samples that wait here while the other kind is awaited; the oldest go first.
_KEPT = 1_024
#: The environment variable that names the port.
_PORT_VARIABLE = "MGW_PORT"
_PART_OF_TTL = 0.9
#: Between two looks at an axis that is stopping, s.
_LOOK_AGAIN = 0.02

#: A configuration: as dataclasses, as a dictionary with the keys of a file, or the path of a file.
ConfigurationLike = Union[Configuration, Mapping[str, Any], str, "os.PathLike[str]"]

_open: "weakref.WeakSet[Gateway]" = weakref.WeakSet()


class MoveTarget(NamedTuple):
    """Where a relative move goes."""

    start_rad: float
    target_rad: float


class Configured(NamedTuple):
    """What a configuration has changed."""

    changes: int
    motor_timeouts_written: int


def connect(port: Optional[str] = None) -> Gateway:
    """Opens a session with a gateway.

    ``port`` is ``"tcp:HOST:PORT"``, ``"unix:PATH"`` of a server or a serial device such as
    ``"/dev/ttyACM0"`` or ``"/dev/ttyACM0@2000000"``. Without it: what ``MGW_PORT`` names, a
    running ``mgw serve``, or the only gateway on USB or an ST-LINK.
    """
    return Gateway(_native.open(port or os.environ.get(_PORT_VARIABLE) or None))


class Gateway:
    """A session with one gateway: :func:`connect` or ``Simulator.connect`` makes it.

    Leaving its ``with`` block stops every axis that was armed in it, however it is left. Nothing
    is sent but by the calls of the program: what hangs stops its motors, when its last setpoint
    has expired. Any thread may call; one call is under way at a time.
    """

    def __init__(self, session: _native.Session, behind: object = None) -> None:
        self._session = session
        # A simulation ends with the last that knows it.
        self._behind = behind
        self._events: Deque[Event] = deque(maxlen=_KEPT)
        self._samples: Deque[Sample] = deque(maxlen=_KEPT)
        # Each subscription and each cycle replaces the one before, which then has nothing to end.
        # Counted, as a reference would keep a session that nobody else has.
        self._subscriptions = 0
        self._cycles = 0
        _open.add(self)

    def __enter__(self) -> Gateway:
        return self

    def __exit__(
        self,
        kind: Optional[Type[BaseException]],
        error: Optional[BaseException],
        trace: Optional[TracebackType],
    ) -> None:
        self.close()

    def __del__(self) -> None:
        session: Optional[_native.Session] = getattr(self, "_session", None)
        if session is None or session.closed or session.process != os.getpid():
            return
        warnings.warn("a Gateway was not closed; use it in a `with` block", ResourceWarning, 2)
        self.close()

    def close(self) -> None:
        """Stops every axis that was armed here and ends the session; the call that another thread
        has under way ends. Closing again does nothing.

        :raises StopUnansweredError: nothing answered the stop.
        """
        self._session.close()
        # Only now: an exception of a signal handler may come before.
        _open.discard(self)

    @property
    def closed(self) -> bool:
        """Whether the session has ended."""
        return self._session.closed

    # What it is, and how.

    def info(self) -> Dict[str, Any]:
        """What the gateway is: what ``mgw info --json`` prints."""
        return self._session.info()

    def axes(self) -> List[Dict[str, Any]]:
        """Every axis that has a parameter set: number, bus, protocol, node, state."""
        return self._session.axes()

    def bus(self, bus: int) -> Dict[str, Any]:
        """How a bus is: configuration, error state, counters."""
        return self._session.bus(bus)

    def state(self, axis: int) -> AxisState:
        """How an axis is; it keeps nothing in motion."""
        return axis_state(self._session.read_state(axis))

    def incidents(self) -> List[Dict[str, Any]]:
        """The last trips and starts, the latest first; they outlive a reset."""
        return self._session.incidents()

    def losses(self) -> Dict[str, int]:
        """What was lost or ignored on the way from the gateway."""
        return self._session.losses()

    def now(self) -> float:
        """The time that this session lives by, s: virtual in a simulation in virtual time."""
        return self._session.now()

    def gateway_now_us(self) -> int:
        """The best guess of the gateway's time."""
        return self._session.gateway_now_us()

    def pause(self, duration_s: float) -> None:
        """Lets time pass and sends nothing. In virtual time this, and not ``time.sleep``."""
        self._session.pause(duration_s)

    # Configuration.

    def configure(
        self,
        configuration: ConfigurationLike,
        *,
        merge: bool = False,
    ) -> Configured:
        """Makes this the configuration of the gateway: a file, a :class:`Configuration`, or a
        dictionary with the keys of the file. With ``merge`` only what it names changes.

        All changes are made together or not at all. ``motor_timeout_ms`` is written to the motors
        afterwards. An axis whose bus or motor changes has to be idle: one that holds is after
        :meth:`output_off`.

        :raises ConfigurationError: with everything that is wrong with it.
        """
        if isinstance(configuration, (str, os.PathLike)):
            path: Optional[str] = os.fspath(configuration)
            text = Path(configuration).read_text(encoding="utf-8")
        else:
            keys = configuration.to_dict() if isinstance(configuration, Configuration) else (
                configuration
            )
            try:
                text = json.dumps(keys)
            except (TypeError, ValueError) as error:
                raise UsageError(f"no configuration: {error}") from error
            _check_finite("configuration", keys)
            path, text = None, _native.toml_of(text)
        return Configured(*self._session.configure(path, text, merge))

    def configuration(self) -> Dict[str, Any]:
        """The configuration of the gateway, with the keys of a file."""
        return self._session.configuration()

    def save_configuration(self) -> None:
        """Stores the configuration, so that it runs again after a loss of power."""
        self._session.save_configuration()

    def forget_stored(self) -> None:
        """Forgets the stored configuration; the running one stays."""
        self._session.forget_stored()

    # Motion.

    def arm(self, *axes: int) -> Armed:
        """Allows axes to move, all of them or none. In a ``with`` block leaving it disarms them."""
        epoch, ttl = self._session.arm(axes)
        return Armed(self, axes, epoch, ttl)

    def stop(self, axis: Optional[int] = None) -> None:
        """Runs the stop action of an axis, or of all.

        The stop of all waits for no call of another thread: it ends that call, unless that only
        listens, and may be used in a signal handler. That of one axis goes out in the middle of a
        ``hold`` of another thread, which ends with an error if it holds that axis, and waits for
        every other call. Needs no authority.
        """
        if axis is None:
            self._session.stop_all()
        else:
            self._session.stop_axis(axis)

    def estop(self) -> None:
        """Emergency stop: trips every axis that may move and latches the gateway until it is
        cleared. It waits for no call of another thread. Needs no authority."""
        self._session.estop()

    def clear(self, axis: Optional[int] = None) -> None:
        """Clears the trip of an axis, or the latched e-stop of the gateway. Never arms."""
        self._session.clear(axis)

    def clear_unreachable(self, axis: int) -> None:
        """Unsafe: clears an axis whose motor does not confirm its stop; it may be turning."""
        self._session.clear_unreachable(axis)

    def clear_by_restart(self, axis: int) -> None:
        """Restarts the motor of a tripped axis, which may drop what it holds, and clears it."""
        self._session.clear_by_restart(axis)

    def output_off(self, axis: int) -> None:
        """Switches off the output of a motor that holds: a load may drop."""
        self._session.output_off(axis)

    def wait_until_stopped(self, *axes: int, timeout: float = 5.0) -> List[AxisState]:
        """Waits until each axis has confirmed its stop, and tells how it is.

        :raises LinkError: one has not in time. The gateway goes on stopping it.
        """
        end = self.now() + timeout
        while True:
            states = [self.state(axis) for axis in axes]
            late = [state.axis for state in states if state.is_stopping]
            if not late:
                return states
            if self.now() >= end:
                raise LinkError(
                    f"axis {late[0]} has not confirmed its stop within {timeout} s; the gateway "
                    "goes on stopping it. Cut its power if it turns",
                    "StopNotConfirmed",
                    None,
                    {"axis": late[0]},
                )
            self.pause(_LOOK_AGAIN)

    def native(self, axis: int, command: str, **values: FieldValue) -> Optional[Dict[str, Any]]:
        """Has the motor of an axis carry out a command of its manual that does not move it.

        Returns its reply in words, None where the motor does not answer this command. For a field
        with the name of an argument of this method write a ``_`` behind it.
        """
        return self._session.native(axis, command, _fields(values), 0, 0.0)

    # What it says by itself.

    def event(self, timeout: float = 0.0) -> Optional[Event]:
        """The next event, or None if none comes in time. Samples are not among them."""
        end = self.now() + timeout
        while not self._events and self._take(max(0.0, end - self.now())):
            pass
        return self._events.popleft() if self._events else None

    def subscribe(
        self, *axes: int, fields: Sequence[str] = FAST_FIELDS, period_s: float = 0.01
    ) -> Samples:
        """Samples of axes, one of each in each period of 1 ms to 10 s: an iterator, and a context
        manager that ends them. It replaces the subscription before."""
        self._session.subscribe(axes, fields, period_s)
        self._subscriptions += 1
        return Samples(self, self._subscriptions)

    def run_cycle(
        self, *axes: int, fields: Sequence[str] = FAST_FIELDS, period_s: float = 0.001
    ) -> RunningCycle:
        """Has the gateway send the setpoints in force of these axes in a period of its own, 250 µs
        to 20 ms, and tell of each: an iterator, and a context manager that ends it. It replaces the
        cycle before. Setpoints have to be said again as ever."""
        self._session.run_cycle(axes, fields, period_s)
        self._cycles += 1
        return RunningCycle(self, self._cycles, axes, period_s)

    def _take(self, timeout: float) -> bool:
        told = self._session.poll_event(timeout)
        if told is None:
            return False
        event = event_of(told)
        if event.name == "sample":
            self._samples.append(sample(event))
        else:
            self._events.append(event)
        return True


class Armed:
    """Axes that may move, as long as their setpoints are said again before they expire.

    Each setpoint carries the epoch of this arming: once an axis was stopped, the gateway refuses
    what is left over from before.
    """

    def __init__(self, gateway: Gateway, axes: Sequence[int], epoch: int, ttl: float) -> None:
        self.gateway = gateway
        #: The axes, as they were named.
        self.axes: Tuple[int, ...] = tuple(axes)
        #: What the gateway knows this arming by.
        self.epoch = epoch
        #: How long a setpoint is valid unless a call says otherwise, s: a tenth less than the least
        #: ``ttl_us`` of the axes, by which the gateway's clock may be taken for wrong.
        self.ttl = ttl * _PART_OF_TTL
        self._longest = ttl
        self._session = gateway._session

    def __enter__(self) -> Armed:
        return self

    def __exit__(
        self,
        kind: Optional[Type[BaseException]],
        error: Optional[BaseException],
        trace: Optional[TracebackType],
    ) -> None:
        if not self._session.closed:
            self.disarm()

    def disarm(self) -> None:
        """Ends the permission to move, through the stop action of each axis."""
        failure: Optional[MotorGatewayError] = None
        for axis in self.axes:
            try:
                self._session.disarm(axis)
            except MotorGatewayError as error:
                failure = failure or error
        if failure is not None:
            raise failure

    def set(self, setpoint: AxisSetpoint, *, ttl: Optional[float] = None) -> None:
        """Says what one axis shall do from now on, for ``ttl`` seconds at most."""
        self._session.set(self.epoch, setpoint, self.ttl if ttl is None else ttl)

    def cycle(
        self,
        setpoints: Sequence[AxisSetpoint],
        *,
        fields: Sequence[str] = FAST_FIELDS,
        ttl: Optional[float] = None,
    ) -> List[CycleState]:
        """Gives each of these axes its setpoint, and returns the state of each as soon as every
        motor has answered or its own time is over, in the order of the axes' numbers.

        One that was refused says so in its ``result``.
        """
        return self._session.cycle(self.epoch, setpoints, fields, self.ttl if ttl is None else ttl)

    def hold(
        self,
        setpoints: Sequence[AxisSetpoint],
        duration_s: float,
        *,
        ttl: Optional[float] = None,
    ) -> None:
        """Keeps setpoints in force for as long as this call lasts, by new ones in time.

        When it returns nothing is sent any more: say something else within ``ttl``, or disarm.
        """
        self._session.hold(
            self.epoch, setpoints, self._longest if ttl is None else ttl, duration_s
        )

    def move(
        self,
        axis: int,
        distance_rad: float,
        speed_limit_rad_s: float,
        *,
        ttl: Optional[float] = None,
    ) -> MoveTarget:
        """Moves an axis by a distance, once: the target holds for ``ttl`` seconds. Keep it up with
        ``make_position`` to it."""
        target = self._session.move_relative(
            self.epoch, axis, distance_rad, speed_limit_rad_s, self.ttl if ttl is None else ttl
        )
        return MoveTarget(*target)

    def native(
        self, axis: int, command: str, *, ttl: Optional[float] = None, **values: FieldValue
    ) -> Optional[Dict[str, Any]]:
        """As :meth:`Gateway.native`, also for what moves: it is valid for ``ttl`` seconds."""
        ttl = self.ttl if ttl is None else ttl
        return self._session.native(axis, command, _fields(values), self.epoch, ttl)


class Samples:
    """The samples of a subscription. Ends it when its ``with`` block is left."""

    def __init__(self, gateway: Gateway, number: int) -> None:
        self._gateway = gateway
        self._number = number
        gateway._samples.clear()

    def __enter__(self) -> Samples:
        return self

    def __exit__(self, *_: object) -> None:
        gateway = self._gateway
        if gateway._subscriptions == self._number and not gateway.closed:
            gateway._session.unsubscribe()

    def __iter__(self) -> Iterator[Sample]:
        while True:
            one = self.next(timeout=1.0)
            if one is not None:
                yield one

    def next(self, timeout: float) -> Optional[Sample]:
        """The next sample, or None if none comes in time. It keeps the subscription alive, and
        nothing in motion."""
        gateway = self._gateway
        gateway._session.keep_subscription()
        end = gateway.now() + timeout
        while not gateway._samples and gateway._take(max(0.0, end - gateway.now())):
            pass
        return gateway._samples.popleft() if gateway._samples else None


class RunningCycle:
    """The periods of a free-running cycle. Ends it when its ``with`` block is left."""

    def __init__(
        self, gateway: Gateway, number: int, axes: Sequence[int], period_s: float
    ) -> None:
        self._gateway = gateway
        self._number = number
        self._axes = tuple(axes)
        #: The period that was asked for.
        self.period_s = period_s

    def __enter__(self) -> RunningCycle:
        return self

    def __exit__(self, *_: object) -> None:
        if not self._gateway.closed:
            self.end()

    def __iter__(self) -> Iterator[CyclePeriod]:
        while True:
            period = self.next(timeout=1.0)
            if period is None:
                raise self._silence()
            yield period

    def next(self, timeout: float) -> Optional[CyclePeriod]:
        """The next period, or None if none is told of in time. Sends nothing."""
        return self._gateway._session.poll_cycle(timeout)

    def end(self) -> None:
        """Ends the cycle, unless another one has replaced it; the axes stay armed for as long as
        their setpoints hold."""
        if self._gateway._cycles == self._number:
            self._gateway._session.end_cycle()

    def _silence(self) -> MotorGatewayError:
        """Why no period is told of: the gateway ends the cycle of a host that says nothing more,
        as one does whose axis has tripped."""
        for axis in self._axes:
            trip = self._gateway.state(axis).trip
            if trip is not None:
                return MotorGatewayError(
                    f"the cycle has ended: axis {axis} has tripped ({trip.reason}). Remove the "
                    "cause, clear the axis, then run the cycle again",
                    "Tripped",
                    None,
                    {"axis": axis, "reason": trip.reason},
                )
        return LinkError("no period of the cycle was told of within 1 s", "NoAnswer")


def _check_finite(name: str, value: object) -> None:
    """JSON has no word for what is no finite number."""
    if isinstance(value, float) and not math.isfinite(value):
        raise UsageError(f"{name} is a finite number, not {value}")
    if isinstance(value, Mapping):
        for key, inner in value.items():
            _check_finite(f"{name}[{key!r}]", inner)
    elif isinstance(value, (list, tuple)):
        for place, inner in enumerate(value):
            _check_finite(f"{name}[{place}]", inner)


def _fields(values: Mapping[str, FieldValue]) -> List[Tuple[str, str]]:
    return field_words({name.rstrip("_"): value for name, value in values.items()})


@atexit.register
def _close_all() -> None:
    """The program ends in order: what it has armed is stopped."""
    for gateway in list(_open):
        try:
            gateway.close()
        except MotorGatewayError as error:
            print(f"motor_gateway: {error}", file=sys.stderr)
