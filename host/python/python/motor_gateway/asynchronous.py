"""The session for programs that await."""

from __future__ import annotations

import asyncio
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import count
from threading import Thread
from types import TracebackType
from typing import (
    AsyncIterator,
    Callable,
    List,
    Optional,
    Sequence,
    Type,
    TypeVar,
)

from ._native import AxisSetpoint, CyclePeriod, CycleState
from .gateway import FAST_FIELDS, Armed, Gateway, RunningCycle, Samples, connect
from .readings import AxisState, Event, Sample

R = TypeVar("R")

#: How long a wait for an event keeps the other calls of this session waiting, s.
_TURN = 0.005


class AsyncGateway:
    """A :class:`Gateway` on a thread of its own, which takes calls in turn.

    A hold that is cancelled stops what is armed here, at once. Any other call that is cancelled
    takes nothing back: what was asked for is done, and a setpoint expires. The thread sends nothing
    by itself: when the event loop hangs, setpoints expire and the gateway stops the motors.
    """

    def __init__(self, gateway: Gateway) -> None:
        #: The session behind it.
        self.gateway = gateway
        self._thread = ThreadPoolExecutor(1, "motor_gateway")
        self._numbers = count(1)

    @classmethod
    async def connect(cls, port: Optional[str] = None) -> AsyncGateway:
        """As :func:`motor_gateway.connect`."""
        return cls(await asyncio.get_running_loop().run_in_executor(None, connect, port))

    async def __aenter__(self) -> AsyncGateway:
        return self

    async def __aexit__(
        self,
        kind: Optional[Type[BaseException]],
        error: Optional[BaseException],
        trace: Optional[TracebackType],
    ) -> None:
        self.close()

    def close(self) -> None:
        """As :meth:`Gateway.close`. It awaits nothing, so nothing can come before the stop."""
        try:
            self.gateway.close()
        finally:
            self._thread.shutdown(wait=False, cancel_futures=True)

    async def call(self, act: Callable[[Gateway], R]) -> R:
        """Does what ``act`` does with the session, in its turn: every method of :class:`Gateway`
        and :class:`Armed` is reached so.

        :raises StopUnansweredError: a hold was cancelled, and nothing answered its stop.
        """
        session, number = self.gateway._session, next(self._numbers)

        def turn() -> R:
            session.begin_turn(number)
            try:
                return act(self.gateway)
            finally:
                session.begin_turn(0)

        future = self._thread.submit(turn)
        try:
            return await asyncio.wrap_future(future)
        except asyncio.CancelledError:
            # Without an await before it, as when a block is left.
            if not future.cancel() and not self.gateway.closed:
                session.end_holds(number)
            raise

    async def arm(self, *axes: int) -> AsyncArmed:
        """As :meth:`Gateway.arm`."""
        return AsyncArmed(self, await self.call(lambda gateway: gateway.arm(*axes)))

    async def state(self, axis: int) -> AxisState:
        """As :meth:`Gateway.state`."""
        return await self.call(lambda gateway: gateway.state(axis))

    async def stop(self, axis: Optional[int] = None) -> None:
        """As :meth:`Gateway.stop`, and sent though it is cancelled. It waits for no work of the
        program, and goes before calls that wait for their turn."""
        await _at_once(lambda: self.gateway.stop(axis))

    async def estop(self) -> None:
        """As :meth:`Gateway.estop`: it waits for no other call, and is sent though it is
        cancelled."""
        await _at_once(self.gateway.estop)

    async def event(self) -> Event:
        """The next event, whenever it comes."""
        while True:
            event = await self.call(lambda gateway: gateway.event(_TURN))
            if event is not None:
                return event

    async def run_cycle(
        self, *axes: int, fields: Sequence[str] = FAST_FIELDS, period_s: float = 0.001
    ) -> AsyncRunningCycle:
        """As :meth:`Gateway.run_cycle`: an async iterator, and an async context manager."""
        running = await self.call(
            lambda gateway: gateway.run_cycle(*axes, fields=fields, period_s=period_s)
        )
        return AsyncRunningCycle(self, running)

    async def subscribe(
        self, *axes: int, fields: Sequence[str] = FAST_FIELDS, period_s: float = 0.01
    ) -> AsyncSamples:
        """As :meth:`Gateway.subscribe`: an async iterator, and an async context manager."""
        samples = await self.call(
            lambda gateway: gateway.subscribe(*axes, fields=fields, period_s=period_s)
        )
        return AsyncSamples(self, samples)


async def _at_once(act: Callable[[], None]) -> None:
    """Does it in a thread of its own, which no other work of the program keeps waiting."""
    done: Future[None] = Future()

    def stop() -> None:
        done.set_running_or_notify_cancel()
        try:
            act()
        except BaseException as error:
            done.set_exception(error)
        else:
            done.set_result(None)

    Thread(target=stop, name="motor_gateway_stop").start()
    await asyncio.shield(asyncio.wrap_future(done))


class AsyncArmed:
    """As :class:`Armed`."""

    def __init__(self, gateway: AsyncGateway, armed: Armed) -> None:
        self._gateway = gateway
        #: The arming behind it, for use in :meth:`AsyncGateway.call`.
        self.armed = armed

    async def __aenter__(self) -> AsyncArmed:
        return self

    async def __aexit__(self, *_: object) -> None:
        # Without an await before it: a cancelled task stops its motors too.
        if not self._gateway.gateway.closed:
            self.armed.disarm()

    async def set(self, setpoint: AxisSetpoint, *, ttl: Optional[float] = None) -> None:
        """As :meth:`Armed.set`."""
        await self._gateway.call(lambda _: self.armed.set(setpoint, ttl=ttl))

    async def cycle(
        self,
        setpoints: Sequence[AxisSetpoint],
        *,
        fields: Sequence[str] = FAST_FIELDS,
        ttl: Optional[float] = None,
    ) -> List[CycleState]:
        """As :meth:`Armed.cycle`."""
        return await self._gateway.call(
            lambda _: self.armed.cycle(setpoints, fields=fields, ttl=ttl)
        )


class AsyncRunningCycle:
    """As :class:`RunningCycle`."""

    def __init__(self, gateway: AsyncGateway, running: RunningCycle) -> None:
        self._gateway = gateway
        self._running = running

    async def __aenter__(self) -> AsyncRunningCycle:
        return self

    async def __aexit__(self, *_: object) -> None:
        if not self._gateway.gateway.closed:
            self._running.end()

    async def __aiter__(self) -> AsyncIterator[CyclePeriod]:
        silent = 0.0
        while True:
            period = await self._gateway.call(lambda _: self._running.next(_TURN))
            silent = 0.0 if period is not None else silent + _TURN
            if period is not None:
                yield period
            elif silent >= 1.0:
                raise await self._gateway.call(lambda _: self._running._silence())


class AsyncSamples:
    """As :class:`Samples`."""

    def __init__(self, gateway: AsyncGateway, samples: Samples) -> None:
        self._gateway = gateway
        self._samples = samples

    async def __aenter__(self) -> AsyncSamples:
        return self

    async def __aexit__(self, *_: object) -> None:
        self._samples.__exit__()

    async def __aiter__(self) -> AsyncIterator[Sample]:
        while True:
            sample = await self._gateway.call(lambda _: self._samples.next(_TURN))
            if sample is not None:
                yield sample
