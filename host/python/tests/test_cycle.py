"""Free-running cycles, subscriptions, record arrays, and programs that await."""

from __future__ import annotations

import asyncio
import math
import subprocess
import sys
import threading
from typing import List

import pytest

from motor_gateway import (
    FOUR_MOTORS,
    STATES,
    AsyncGateway,
    CyclePeriod,
    Gateway,
    InterruptedCallError,
    LinkError,
    MotorGatewayError,
    Sample,
    Simulator,
    as_array,
    make_velocity,
)

PERIOD_S = 0.004


def test_a_free_running_cycle_tells_of_each_period(gateway: Gateway) -> None:
    told: List[CyclePeriod] = []
    with gateway.arm(0, 2) as motors:
        with gateway.run_cycle(0, 2, fields=["position", "velocity"], period_s=PERIOD_S) as cycle:
            for period in cycle:
                if period.period % 10 == 0:
                    motors.cycle([make_velocity(0, 2.0), make_velocity(2, -2.0)])
                told.append(period)
                if len(told) == 200:
                    break
        while cycle.next(timeout=0.0):
            pass
        assert cycle.next(timeout=0.05) is None, "it has ended"
    numbers = [period.period for period in told]
    assert numbers == list(range(numbers[0], numbers[0] + 200))
    spans = [b.time_us - a.time_us for a, b in zip(told, told[1:])]
    assert sum(spans) / len(spans) == pytest.approx(PERIOD_S * 1e6, rel=0.02)
    last = told[-1]
    assert [state.axis for state in last.states] == [0, 2]
    assert last.states[0].velocity_rad_s == pytest.approx(2.0, abs=0.1)
    assert last.states[0].current_a is None
    assert set(last.overruns) == {"bus", "motor", "host", "gateway"}
    assert last.took_us <= PERIOD_S * 1e6 and last.dropped == 0


def test_the_cycle_keeps_no_setpoint_longer_than_it_is_valid(gateway: Gateway) -> None:
    with gateway.arm(0) as motors, gateway.run_cycle(0, period_s=PERIOD_S) as cycle:
        motors.set(make_velocity(0, 2.0))
        said = gateway.gateway_now_us()
        for period in cycle:
            if period.states[0].state == "tripped":
                break
        assert period.time_us - said < motors.ttl * 1e6 + 10_000
        trip = gateway.state(0).trip
        assert trip is not None and trip.reason == "setpoint_expired"


def test_slow_fields_come_in_turns(gateway: Gateway) -> None:
    with gateway.arm(0, 2) as motors:
        fields = ["velocity", "voltage", "faults"]
        with gateway.run_cycle(0, 2, fields=fields, period_s=PERIOD_S) as cycle:
            motors.cycle([make_velocity(0, 2.0), make_velocity(2, 2.0)])
            slow = [period.slow for _, period in zip(range(40), cycle)]
    axes = [one["axis"] for one in slow if one is not None]
    assert set(axes) == {0, 2}
    assert any(one is not None and one["voltage_v"] is not None for one in slow)


def test_a_cycle_that_is_not_told_of_is_told(gateway: Gateway) -> None:
    with gateway.run_cycle(0, period_s=PERIOD_S) as cycle:
        pass
    with pytest.raises(LinkError, match="no period"):
        for _ in zip(range(10_000), cycle):
            pass


def test_a_cycle_that_a_trip_has_ended_tells_the_trip(gateway: Gateway) -> None:
    gateway.arm(0).set(make_velocity(0, 2.0))
    with gateway.run_cycle(2, 0, period_s=PERIOD_S) as cycle:
        with pytest.raises(MotorGatewayError, match=r"axis 0 .* \(setpoint_expired\)") as told:
            for _ in zip(range(10_000), cycle):
                pass
    assert (told.value.name, told.value.fields["axis"]) == ("Tripped", 0)

    async def awaiting() -> None:
        async with await AsyncGateway(gateway).run_cycle(0, period_s=PERIOD_S) as cycle:
            async for _ in cycle:
                pass

    with pytest.raises(MotorGatewayError, match="axis 0 has tripped"):
        asyncio.run(awaiting())


def test_what_was_replaced_ends_nothing(gateway: Gateway) -> None:
    first = gateway.run_cycle(0, period_s=PERIOD_S)
    with gateway.run_cycle(2, period_s=PERIOD_S) as cycle:
        first.end()
        period = cycle.next(timeout=0.1)
        while period is not None and period.states[0].axis == 0:
            period = cycle.next(timeout=0.1)
        assert period is not None
    while cycle.next(timeout=0.0):
        pass
    assert cycle.next(timeout=0.05) is None, "its own end ends it"
    with gateway.subscribe(0, period_s=0.01):
        samples = gateway.subscribe(2, period_s=0.01)
    last = [samples.next(timeout=0.1) for _ in range(10)][-1]
    assert last is not None and last.axis == 2


def test_samples_and_events_come_apart(gateway: Gateway) -> None:
    while gateway.event():
        pass
    with gateway.subscribe(0, 1, period_s=0.01) as samples:
        with gateway.arm(0) as motors:
            motors.hold([make_velocity(0, 2.0)], 0.3)
        taken = [sample for _, sample in zip(range(40), samples)]
        event = gateway.event(timeout=0.1)
    assert {sample.axis for sample in taken} == {0, 1}
    turning = [one.velocity_rad_s for one in taken if one.axis == 0 and one.state == "active"]
    assert turning[-1] is not None and turning[-1].value == pytest.approx(2.0, abs=0.1)
    assert event is not None and event.name == "state_changed"
    assert gateway.losses()["events_lost"] == 0


def test_states_periods_and_samples_as_record_arrays(gateway: Gateway) -> None:
    numpy = pytest.importorskip("numpy")
    with gateway.arm(0, 2) as motors:
        setpoints = [make_velocity(0, 2.0), make_velocity(2, 1.0)]
        motors.hold(setpoints, 0.3)
        states = motors.cycle(setpoints, fields=["position", "velocity", "faults"])
        array = as_array(states)
        assert array["axis"].tolist() == [0, 2] and array["answered"].all()
        assert [STATES[number] for number in array["state"]] == ["active", "active"]
        assert array["velocity_rad_s"][0] == numpy.float32(states[0].velocity_rad_s)
        assert array["position_rad"][1] == numpy.float32(states[1].position_rad)
        assert numpy.isnan(array["current_a"]).all() and array["faults_raw"].tolist() == [0, 0]
        assert array["age_us"].tolist() == [state.age_us for state in states]

        with gateway.run_cycle(0, 2, period_s=PERIOD_S) as cycle:
            periods = [period for _, period in zip(range(20), cycle)]
    array = as_array(periods)
    assert array.shape == (40,)
    assert array["period"].tolist() == [period.period for period in periods for _ in range(2)]
    assert array["time_us"][-1] == periods[-1].time_us
    assert array["took_us"][0] == periods[0].took_us
    assert array["velocity_rad_s"][0] == numpy.float32(periods[0].states[0].velocity_rad_s)

    with gateway.subscribe(0, fields=["velocity"], period_s=0.01) as samples:
        taken: List[Sample] = [sample for _, sample in zip(range(5), samples)]
    array = as_array(taken)
    assert array["time_us"].tolist() == [sample.time_us for sample in taken]
    assert numpy.isnan(array["position_rad"]).all() and not numpy.isnan(array["velocity_rad_s"][0])
    assert as_array([]).shape == (0,)


def test_without_numpy_everything_else_works() -> None:
    program = (
        "import sys; sys.modules['numpy'] = None\n"
        "from motor_gateway import *\n"
        "with Simulator().connect(FOUR_MOTORS) as gateway, gateway.arm(0) as motors:\n"
        "    states = motors.cycle([make_velocity(0, 1.0)])\n"
        "    try:\n        as_array(states)\n        raise SystemExit(1)\n"
        "    except ImportError:\n        pass\n"
    )
    assert subprocess.run([sys.executable, "-c", program], timeout=60).returncode == 0


def test_a_program_that_awaits(simulator: Simulator) -> None:
    async def turn() -> float:
        async with AsyncGateway(simulator.connect(FOUR_MOTORS)) as gateway:
            async with await gateway.arm(0, 2) as motors:
                for step in range(50):
                    speed = 2.0 * math.sin(step / 10)
                    states = await motors.cycle([make_velocity(0, speed), make_velocity(2, 1.0)])
                assert [state.result for state in states] == ["answered", "answered"]
                count = 0
                async with await gateway.run_cycle(0, 2, period_s=PERIOD_S) as cycle:
                    async for period in cycle:
                        await motors.set(make_velocity(0, 1.0))
                        await motors.set(make_velocity(2, 1.0))
                        count += len(period.states)
                        if count == 40:
                            break
            event = await gateway.event()
            assert event.name
            async with await gateway.subscribe(0, period_s=0.02) as samples:
                async for sample in samples:
                    assert sample.axis == 0
                    break
            state = await gateway.state(0)
            await gateway.stop()
            assert not state.is_armed and state.trip is None
            return await gateway.call(lambda inner: inner.now())

    assert asyncio.run(turn()) < 5.0


def test_a_task_that_is_cancelled_stops_its_motors(served: Simulator) -> None:
    async def turn() -> None:
        async with AsyncGateway(served.connect()) as gateway:
            async with await gateway.arm(0) as motors:
                while True:
                    await motors.cycle([make_velocity(0, 2.0)])

    async def program() -> None:
        task = asyncio.create_task(turn())
        while served.motors()[0]["velocity_rad_s"] < 1.0:
            await asyncio.sleep(0.01)
        task.cancel()
        with pytest.raises((asyncio.CancelledError, InterruptedCallError)):
            await task

    asyncio.run(program())
    with served.connect() as gateway:
        [state] = gateway.wait_until_stopped(0)
        assert (state.state, state.trip) == ("holding", None)


@pytest.mark.parametrize("late", [False, True])
def test_a_hold_that_is_cancelled_stops_its_motors_and_a_wait_that_is_stops_none(
    served: Simulator, late: bool
) -> None:
    begun = threading.Event()

    async def program() -> None:
        async with AsyncGateway(served.connect()) as gateway:
            motors = await gateway.arm(0)

            def hold(inner: Gateway) -> None:
                begun.set()
                if late:
                    inner.pause(0.2)
                motors.armed.hold([make_velocity(0, 2.0)], 3600.0)

            await motors.set(make_velocity(0, 2.0))
            with pytest.raises(asyncio.TimeoutError):
                await asyncio.wait_for(gateway.call(lambda inner: inner.pause(0.2)), 0.1)
            assert (await gateway.state(0)).state == "active"
            holding = asyncio.create_task(gateway.call(hold))
            while not begun.is_set():
                await asyncio.sleep(0.01)
            if not late:
                await asyncio.sleep(0.1)
            holding.cancel()
            with pytest.raises(asyncio.CancelledError):
                await holding
            if late:
                # What it did before goes on, and comes to no hold.
                await gateway.call(lambda inner: inner.now())
            state = await gateway.state(0)
            assert state.state in ("stopping", "holding") and state.trip is None
            # The session goes on.
            await gateway.call(lambda inner: inner.wait_until_stopped(0))
            async with await gateway.arm(0) as motors:
                await motors.set(make_velocity(0, 2.0))

    asyncio.run(asyncio.wait_for(program(), 60.0))


def test_a_stop_waits_for_no_other_work_of_the_program(served: Simulator) -> None:
    """Neither for the threads of the event loop, which are busy, nor for a hold of its session; and
    it is sent though nobody awaits it any more."""
    free = threading.Event()

    async def program() -> None:
        loop = asyncio.get_running_loop()
        busy = [loop.run_in_executor(None, free.wait) for _ in range(64)]
        async with AsyncGateway(served.connect()) as gateway:
            armed = (await gateway.arm(0)).armed
            velocity = [make_velocity(0, 2.0)]
            hold = gateway.call(lambda _: armed.hold(velocity, 3600.0))
            holding = asyncio.create_task(hold)
            while served.motors()[0]["velocity_rad_s"] < 1.0:
                await asyncio.sleep(0.01)
            stop = asyncio.create_task(gateway.stop(0))
            await asyncio.sleep(0)
            stop.cancel()
            with pytest.raises(asyncio.CancelledError):
                await stop
            with pytest.raises(MotorGatewayError):
                await holding
            await gateway.call(lambda inner: inner.wait_until_stopped(0))
        free.set()
        await asyncio.gather(*busy)

    try:
        asyncio.run(asyncio.wait_for(program(), 60.0))
    finally:
        free.set()


def test_an_event_loop_that_hangs_keeps_nothing_in_motion(served: Simulator) -> None:
    import time

    async def program() -> None:
        async with AsyncGateway(served.connect()) as gateway:
            motors = await gateway.arm(0)
            await motors.set(make_velocity(0, 2.0))
            time.sleep(1.5)
            state = await gateway.state(0)
            assert state.trip is not None and state.trip.reason == "setpoint_expired"

    asyncio.run(program())
