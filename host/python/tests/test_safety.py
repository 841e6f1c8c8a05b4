"""What becomes of the motors when a program ends, hangs, forks or is interrupted."""

from __future__ import annotations

import asyncio
import gc
import os
import signal
import subprocess
import sys
import threading
import time
import weakref
from contextlib import suppress
from typing import Any, Callable, Dict, Iterator, List

import pytest
from conftest import SERVED_TTL_US

from motor_gateway import (
    FOUR_MOTORS,
    AsyncArmed,
    AsyncGateway,
    AxisState,
    ClosedError,
    Gateway,
    GatewayError,
    InterruptedCallError,
    LinkError,
    Simulator,
    StopUnansweredError,
    make_velocity,
)

#: Generous: the machine may be busy.
PATIENCE_S = 30.0


def look(simulator: Simulator, axis: int = 0) -> AxisState:
    """How an axis is, told to a session that has nothing to do with it."""
    with simulator.connect() as other:
        return other.state(axis)


def test_leaving_by_an_exception_stops(simulator: Simulator) -> None:
    with pytest.raises(RuntimeError, match="by mistake"):
        with simulator.connect(FOUR_MOTORS) as gateway:
            motors = gateway.arm(0)
            motors.hold([make_velocity(0, 2.0)], 0.5)
            left = simulator.now()
            raise RuntimeError("by mistake")
    # The stop was taken before the block was left: in a few ms, and not by an expiry after 100.
    assert simulator.now() - left < 0.02
    state = look(simulator)
    assert state.state in ("stopping", "holding") and state.trip is None
    simulator.advance(1.0)
    assert look(simulator).state == "holding"
    assert abs(simulator.motors()[0]["velocity_rad_s"]) < 0.1


def test_a_program_that_hangs_says_nothing_and_its_motor_trips(simulator: Simulator) -> None:
    with simulator.connect(FOUR_MOTORS) as gateway:
        motors = gateway.arm(0)
        motors.hold([make_velocity(0, 2.0)], 0.5)
        motors.set(make_velocity(0, 2.0))
        said_us = gateway.gateway_now_us()
        # The session is there, with all its threads, and the program does nothing.
        simulator.advance(0.5)
        trip = gateway.state(0).trip
        assert trip is not None and trip.reason == "setpoint_expired"
        assert trip.time_us - said_us <= motors.ttl * 1e6
        assert abs(simulator.motors()[0]["velocity_rad_s"]) < 0.1


@pytest.mark.parametrize("how", ["pause", "events", "states of another axis"])
def test_listening_keeps_nothing_in_motion(simulator: Simulator, how: str) -> None:
    with simulator.connect(FOUR_MOTORS) as gateway:
        motors = gateway.arm(0)
        motors.set(make_velocity(0, 2.0))
        end = gateway.now() + 0.3
        while gateway.now() < end:
            if how == "pause":
                gateway.pause(0.05)
            elif how == "events":
                gateway.event(timeout=0.05)
            else:
                gateway.state(2)
        trip = gateway.state(0).trip
        assert trip is not None and trip.reason == "setpoint_expired"


def test_a_subscription_keeps_nobody_in_command(simulator: Simulator) -> None:
    with simulator.connect(FOUR_MOTORS) as gateway:
        gateway.arm(0)
        with gateway.subscribe(0, period_s=0.05) as samples:
            states = [sample.state for _, sample in zip(range(60), samples)]
    assert states[0] == "armed"
    # The silence of the link, 250 ms, ends the arming long before the first ping of 1 s.
    assert states[10] in ("stopping", "holding", "idle"), states


def test_garbage_is_stopped_and_told(simulator: Simulator) -> None:
    gateway = simulator.connect(FOUR_MOTORS)
    motors = gateway.arm(0)
    motors.hold([make_velocity(0, 2.0)], 0.2)
    before = simulator.now()
    with pytest.warns(ResourceWarning, match="use it in a `with` block"):
        del gateway, motors
        gc.collect()
    assert simulator.now() - before < 0.02
    state = look(simulator)
    assert state.state in ("stopping", "holding") and state.trip is None


def test_a_cycle_and_a_subscription_keep_no_session_that_nobody_has(simulator: Simulator) -> None:
    gateway = simulator.connect(FOUR_MOTORS)
    known = weakref.ref(gateway)
    gc.disable()
    try:
        with pytest.warns(ResourceWarning, match="use it in a `with` block"):
            motors, cycle, samples = gateway.arm(0), gateway.run_cycle(0), gateway.subscribe(0)
            motors.set(make_velocity(0, 2.0))
            del gateway, motors, cycle, samples
        assert known() is None
    finally:
        gc.enable()
    state = look(simulator)
    assert state.state in ("stopping", "holding") and state.trip is None


def test_the_native_session_alone_stops_when_it_is_dropped(simulator: Simulator) -> None:
    from motor_gateway import _native

    simulator.connect(FOUR_MOTORS).close()
    native = simulator._native
    session: _native.Session = native.connect()
    epoch, ttl = session.arm([0])
    session.hold(epoch, [make_velocity(0, 2.0)], ttl, 0.2)
    del session
    state = look(simulator)
    assert state.state in ("stopping", "holding") and state.trip is None


def test_a_stop_that_nothing_answers_is_told(simulator: Simulator) -> None:
    gateway = simulator.connect(FOUR_MOTORS)
    gateway.arm(0).set(make_velocity(0, 2.0))
    simulator.fault("power off")
    begin = simulator.now()
    with pytest.raises(StopUnansweredError) as told:
        gateway.close()
    assert told.value.name == "StopUnanswered" and "Cut their power" in str(told.value)
    assert 2.9 < simulator.now() - begin < 3.2
    assert gateway.closed


@pytest.mark.parametrize("block", ["gateway", "armed", "async gateway", "async armed"])
def test_a_stop_that_nothing_answers_hides_no_mistake_of_the_program(
    simulator: Simulator, block: str
) -> None:
    gateway = simulator.connect(FOUR_MOTORS)
    motors = gateway.arm(0)
    blocks: Dict[str, Any] = {
        "gateway": gateway,
        "armed": motors,
        "async gateway": (both := AsyncGateway(gateway)),
        "async armed": AsyncArmed(both, motors),
    }

    def mistake() -> None:
        simulator.fault("power off")
        raise RuntimeError("by mistake")

    async def awaiting() -> None:
        async with blocks[block]:
            mistake()

    with pytest.raises(LinkError) as told:
        if block.startswith("async"):
            asyncio.run(awaiting())
        else:
            with blocks[block]:
                mistake()
    assert isinstance(told.value.__context__, RuntimeError)
    with suppress(StopUnansweredError):
        gateway.close()


@pytest.fixture
def interrupts() -> Iterator[Callable[[float], None]]:
    """Sends SIGINT to this process after some time."""
    timers: List[threading.Timer] = []

    def later(after_s: float) -> None:
        timer = threading.Timer(after_s, os.kill, (os.getpid(), signal.SIGINT))
        timers.append(timer)
        timer.start()

    yield later
    for timer in timers:
        timer.join()


@pytest.mark.parametrize("call", ["hold", "pause", "event", "cycles"])
def test_ctrl_c_in_a_call_stops_before_it_is_told(
    simulator: Simulator, interrupts: Callable[[float], None], call: str
) -> None:
    with simulator.connect(FOUR_MOTORS) as gateway:
        motors = gateway.arm(0)
        setpoint = make_velocity(0, 2.0)
        motors.hold([setpoint], 0.2)
        began = time.monotonic()
        interrupts(0.2)
        with pytest.raises(KeyboardInterrupt):
            if call == "hold":
                motors.hold([setpoint], 1e6)
            elif call == "pause":
                gateway.pause(1e6)
            elif call == "event":
                while True:
                    gateway.event(timeout=1e6)
            else:
                while True:
                    motors.cycle([setpoint])
        assert time.monotonic() - began < PATIENCE_S
        if call == "hold":
            state = gateway.state(0)
            assert state.state in ("stopping", "holding") and state.trip is None
    state = look(simulator)
    assert not state.is_armed
    # It is over, and can begin anew.
    with simulator.connect() as gateway:
        if state.trip is not None:
            gateway.wait_until_stopped(0)
            gateway.clear(0)
        gateway.wait_until_stopped(0)
        with gateway.arm(0) as motors:
            motors.set(setpoint)


def test_after_ctrl_c_the_same_session_can_arm_again(
    simulator: Simulator, interrupts: Callable[[float], None]
) -> None:
    with simulator.connect(FOUR_MOTORS) as gateway:
        motors = gateway.arm(0)
        interrupts(0.2)
        with pytest.raises(KeyboardInterrupt):
            motors.hold([make_velocity(0, 2.0)], 1e6)
        gateway.wait_until_stopped(0)
        with gateway.arm(0) as motors:
            motors.hold([make_velocity(0, 2.0)], 0.2)
            assert gateway.state(0).state == "active"


def test_a_signal_handler_that_returns_ends_nothing(gateway: Gateway) -> None:
    calls: List[int] = []
    before = signal.signal(signal.SIGALRM, lambda *_: calls.append(1))
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.05)
        with gateway.arm(0) as motors:
            while not calls:
                motors.hold([make_velocity(0, 2.0)], 1.0)
            assert gateway.state(0).state == "active"
    finally:
        signal.signal(signal.SIGALRM, before)


def test_a_signal_handler_may_stop(gateway: Gateway) -> None:
    raised: List[BaseException] = []

    def handler(*_: object) -> None:
        try:
            gateway.state(0)
        except InterruptedCallError as error:
            raised.append(error)
        gateway.stop()

    before = signal.signal(signal.SIGALRM, handler)
    try:
        motors = gateway.arm(0)
        signal.setitimer(signal.ITIMER_REAL, 0.1)
        with pytest.raises(InterruptedCallError):
            motors.hold([make_velocity(0, 2.0)], 1e6)
        assert [getattr(error, "name") for error in raised] == ["Reentered"]
        state = gateway.state(0)
        assert state.state in ("stopping", "holding") and state.trip is None
    finally:
        signal.signal(signal.SIGALRM, before)


def test_an_e_stop_of_a_signal_handler_is_one(gateway: Gateway) -> None:
    calls: List[int] = []

    def handler(*_: object) -> None:
        calls.append(1)
        gateway.estop()

    before = signal.signal(signal.SIGALRM, handler)
    try:
        for armed in (True, False):
            signal.setitimer(signal.ITIMER_REAL, 0.1)
            if armed:
                motors = gateway.arm(0)
                with pytest.raises(InterruptedCallError):
                    motors.hold([make_velocity(0, 2.0)], 1e6)
            else:
                # Who only listens goes on.
                while len(calls) < 2:
                    gateway.pause(0.4)
            with pytest.raises(GatewayError) as refused:
                gateway.arm(0)
            assert refused.value.name == "EStopped"
            gateway.wait_until_stopped(0)
            gateway.clear()
            gateway.clear(0)
    finally:
        signal.signal(signal.SIGALRM, before)


def test_a_stop_of_another_thread_waits_for_nothing(served: Simulator) -> None:
    with served.connect() as gateway:
        motors = gateway.arm(0)
        ended: List[BaseException] = []

        def turn() -> None:
            try:
                motors.hold([make_velocity(0, 2.0)], 3600.0)
            except InterruptedCallError as error:
                ended.append(error)

        thread = threading.Thread(target=turn)
        thread.start()
        # This thread runs: the interpreter's lock is free while the other one waits.
        while served.motors()[0]["velocity_rad_s"] < 1.0:
            time.sleep(0.01)
        gateway.stop()
        thread.join(PATIENCE_S)
        assert not thread.is_alive() and len(ended) == 1
        [state] = gateway.wait_until_stopped(0)
        assert state.trip is None


def test_a_stop_of_one_axis_goes_out_in_a_hold_of_another_thread(served: Simulator) -> None:
    with served.connect() as gateway:
        motors = gateway.arm(0)
        gateway.arm(2)
        ended: List[GatewayError] = []

        def turn() -> None:
            try:
                motors.hold([make_velocity(0, 2.0)], PATIENCE_S)
            except GatewayError as error:
                ended.append(error)

        thread = threading.Thread(target=turn)
        thread.start()
        while served.motors()[0]["velocity_rad_s"] < 1.0:
            time.sleep(0.01)
        # Who is refused hears of it, and the hold goes on.
        with pytest.raises(GatewayError):
            gateway.stop(20)
        # So it does where another axis is stopped.
        gateway.stop(2)
        assert look(served, 0).state == "active" and look(served, 2).state != "armed"
        assert thread.is_alive()
        gateway.stop(0)
        thread.join(PATIENCE_S)
        assert not thread.is_alive() and [error.name for error in ended] == ["NotArmed"]
        [state] = gateway.wait_until_stopped(0)
        assert state.trip is None


def test_a_stop_leaves_who_only_listens_alone(served: Simulator) -> None:
    with served.connect() as gateway:
        told: List[str] = []
        over = threading.Event()

        def watch() -> None:
            while (event := gateway.event(timeout=1.0)) or not over.is_set():
                told.append(event.name if event else "")

        thread = threading.Thread(target=watch)
        thread.start()
        for _ in range(20):
            gateway.arm(0).set(make_velocity(0, 1.0))
            gateway.stop()
            [state] = gateway.wait_until_stopped(0)
            # It did not wait for who waits for events, whole seconds.
            assert state.trip is None
        over.set()
        thread.join(PATIENCE_S)
        assert not thread.is_alive() and told.count("tripped") == 0


def test_closing_ends_the_call_of_another_thread(served: Simulator) -> None:
    gateway = served.connect()
    motors = gateway.arm(0)
    ended: List[BaseException] = []

    def turn() -> None:
        try:
            motors.hold([make_velocity(0, 2.0)], 3600.0)
        except (InterruptedCallError, ClosedError) as error:
            ended.append(error)

    thread = threading.Thread(target=turn)
    thread.start()
    while served.motors()[0]["velocity_rad_s"] < 1.0:
        time.sleep(0.01)
    gateway.close()
    thread.join(PATIENCE_S)
    assert not thread.is_alive() and len(ended) == 1
    assert look(served).trip is None


PROGRAM = """
import os, signal, sys, time
from motor_gateway import connect, make_velocity
gateway = connect(sys.argv[1])
motors = gateway.arm(0)
def turn():
    motors.cycle([make_velocity(0, 2.0)])
for _ in range(50):
    turn()
"""


def run(served: Simulator, program: str) -> "subprocess.Popen[str]":
    assert served.port is not None
    arguments = [sys.executable, "-c", PROGRAM + program, served.port]
    return subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def at_rest(served: Simulator) -> AxisState:
    with served.connect() as gateway:
        [state] = gateway.wait_until_stopped(0, timeout=PATIENCE_S)
        return state


@pytest.mark.parametrize(
    ("ending", "code"),
    [
        ("", 0),
        ("sys.exit(3)", 3),
        ("raise RuntimeError('by mistake')", 1),
        ("signal.signal(signal.SIGTERM, lambda *_: sys.exit(4))\n"
         "os.kill(os.getpid(), signal.SIGTERM)\ntime.sleep(30)", 4),
    ],
)
def test_the_end_of_the_interpreter_stops(served: Simulator, ending: str, code: int) -> None:
    program = run(served, ending)
    _, errors = program.communicate(timeout=PATIENCE_S)
    assert program.returncode == code, errors
    state = at_rest(served)
    # By the program, and not by the gateway on its own.
    assert (state.state, state.trip) == ("holding", None)


HOLD = """
import threading
holding = threading.Thread(target=lambda: motors.hold([make_velocity(0, 2.0)], 3600), daemon={})
holding.start()
time.sleep(0.3)
raise RuntimeError("by mistake")
"""


def test_a_thread_that_outlives_the_main_one_goes_on_and_a_daemon_is_stopped(
    served: Simulator,
) -> None:
    program = run(served, HOLD.format(False))
    assert program.stderr is not None
    while "by mistake" not in program.stderr.readline():
        pass
    time.sleep(2 * SERVED_TTL_US / 1e6)
    assert program.poll() is None and look(served).state == "active"
    program.kill()
    program.communicate(timeout=PATIENCE_S)
    with served.connect() as gateway:
        at_rest_when_tripped(served)
        gateway.clear(0)
    program = run(served, HOLD.format(True))
    program.communicate(timeout=PATIENCE_S)
    state = at_rest(served)
    assert (state.state, state.trip) == ("holding", None)


def test_ctrl_c_in_a_program_that_cycles_stops(served: Simulator) -> None:
    program = run(served, "print('turning', flush=True)\nwhile True: turn()")
    assert program.stdout is not None and program.stdout.readline() == "turning\n"
    program.send_signal(signal.SIGINT)
    _, errors = program.communicate(timeout=PATIENCE_S)
    assert program.returncode in (-signal.SIGINT, 130) and "KeyboardInterrupt" in errors
    state = at_rest(served)
    assert (state.state, state.trip) == ("holding", None)


@pytest.mark.parametrize("ending", ["SIGKILL", "SIGTERM", "SIGSTOP", "spin"])
def test_what_ends_without_a_word_or_hangs_is_tripped_by_the_gateway(
    served: Simulator, ending: str
) -> None:
    last = "while True: pass" if ending == "spin" else "while True: turn()"
    program = run(served, f"print('turning', flush=True)\n{last}")
    assert program.stdout is not None and program.stdout.readline() == "turning\n"
    try:
        if ending != "spin":
            program.send_signal(getattr(signal, ending))
        state = at_rest_when_tripped(served)
        assert state.trip is not None and state.trip.reason in ("setpoint_expired", "host_silent")
        assert abs(served.motors()[0]["velocity_rad_s"]) < 0.1
    finally:
        program.kill()
        program.communicate(timeout=PATIENCE_S)


def at_rest_when_tripped(served: Simulator) -> AxisState:
    end = time.monotonic() + PATIENCE_S
    with served.connect() as gateway:
        while gateway.state(0).state != "tripped" and time.monotonic() < end:
            time.sleep(0.01)
        [state] = gateway.wait_until_stopped(0, timeout=PATIENCE_S)
        return state


FORK = """
child = os.fork()
if child == 0:
    from motor_gateway import ClosedError
    try:
        turn()
        os._exit(1)
    except ClosedError as error:
        assert error.name == "Forked", error
    gateway.close()
    del motors, turn, gateway
    sys.exit(7)
status = None
while status is None:
    turn()
    done, code = os.waitpid(child, os.WNOHANG)
    status = code if done else None
assert os.waitstatus_to_exitcode(status) == 7, status
for _ in range(50):
    [state] = motors.cycle([make_velocity(0, 2.0)])
assert state.state == "active" and state.answered, state
gateway.close()
"""


def test_a_fork_has_no_session_and_disturbs_none(served: Simulator) -> None:
    program = run(served, FORK)
    _, errors = program.communicate(timeout=PATIENCE_S)
    assert program.returncode == 0, errors
    state = at_rest(served)
    assert (state.state, state.trip) == ("holding", None)
