"""Arming, setpoints, states and refusals, in virtual time."""

from __future__ import annotations

import math
from typing import Any, Callable, Dict, List

import pytest

from motor_gateway import (
    FOUR_MOTORS,
    ClosedError,
    Gateway,
    GatewayError,
    Simulator,
    UsageError,
    make_current,
    make_impedance,
    make_position,
    make_signal,
    make_velocity,
)


def test_a_velocity_is_held_and_the_motor_turns(gateway: Gateway, simulator: Simulator) -> None:
    with gateway.arm(0) as motors:
        assert gateway.state(0).state == "armed"
        motors.hold([make_velocity(0, 2.0)], 0.5)
        state = gateway.state(0)
        assert state.state == "active" and state.is_armed
        assert state.velocity_rad_s is not None
        assert state.velocity_rad_s.value == pytest.approx(2.0, abs=0.1)
        assert simulator.motors()[0]["velocity_rad_s"] == pytest.approx(2.0, abs=0.1)
    [state] = gateway.wait_until_stopped(0)
    assert (state.state, state.trip) == ("holding", None)
    assert abs(simulator.motors()[0]["velocity_rad_s"]) < 0.1


def test_one_call_gives_every_axis_its_setpoint(gateway: Gateway) -> None:
    with gateway.arm(0, 1, 2, 3) as motors:
        for _ in range(100):
            states = motors.cycle(
                [make_velocity(3, 3.0), make_signal(1, 0.1), make_velocity(2, -2.0),
                 make_velocity(0, 1.0)],
                fields=["position", "velocity", "current", "faults"],
            )
    assert [state.axis for state in states] == [0, 1, 2, 3]
    assert all(state.answered and state.state == "active" for state in states)
    velocities = [state.velocity_rad_s for state in states]
    assert velocities[0] == pytest.approx(1.0, abs=0.1)
    assert velocities[2] == pytest.approx(-2.0, abs=0.1)
    assert states[0].faults_raw == 0 and states[0].voltage_v is None


def test_a_setpoint_that_is_refused_says_why_and_the_others_are_taken(gateway: Gateway) -> None:
    with gateway.arm(0, 2) as motors:
        fast, slow = motors.cycle([make_velocity(0, 200.0), make_velocity(2, 1.0)])
    assert (fast.result, fast.answered, fast.error_number) == ("out_of_range", False, 8)
    assert (slow.result, slow.answered, slow.error_number) == ("answered", True, None)


def test_every_kind_of_setpoint(gateway: Gateway) -> None:
    merged = {"axis": [{"axis": 0, "torque_limit_nm": 5.0, "current_limit_a": 10.0}]}
    gateway.configure(merged, merge=True)
    with gateway.arm(0) as motors:
        motors.set(make_current(0, 0.2))
        motors.set(make_position(0, 0.1, 2.0))
        motors.set(make_impedance(0, 0.1, 0.0, 5.0, 0.5, 0.0))
        assert repr(make_velocity(0, 2.0)).startswith("AxisSetpoint(axis=0, Velocity")
        assert make_velocity(0, 2.0) == make_velocity(0, 2.0) != make_velocity(1, 2.0)
        start, target = motors.move(0, math.pi / 2, 3.0)
        assert target - start == pytest.approx(math.pi / 2, abs=1e-4)
        motors.hold([make_position(0, target, 3.0)], 2.0)
        position = gateway.state(0).position_rad
        assert position is not None and position.value == pytest.approx(target, abs=0.02)


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf, 1e300])
def test_a_setpoint_of_no_number_is_refused_when_it_is_made(wrong: float) -> None:
    makes: Dict[str, Callable[[], Any]] = {
        "fraction": lambda: make_signal(0, wrong),
        "current_a": lambda: make_current(0, wrong),
        "velocity_rad_s": lambda: make_velocity(0, wrong),
        "speed_limit_rad_s": lambda: make_position(0, 0.0, wrong),
        "torque_nm": lambda: make_impedance(0, 0.0, 0.0, 1.0, 1.0, wrong),
    }
    for name, make in makes.items():
        with pytest.raises(UsageError, match=f"{name} is a finite number, not (NaN|-?inf)"):
            make()


def test_a_refusal_is_an_exception_with_the_gateways_name_number_and_fields(
    gateway: Gateway,
) -> None:
    with gateway.arm(0) as motors, pytest.raises(GatewayError) as refused:
        motors.set(make_velocity(0, 200.0))
    error = refused.value
    assert (error.name, error.number) == ("OutOfRange", 8)
    assert error.fields == {
        "quantity": "velocity", "unit": "rad/s", "value": 200.0, "min": -30.0, "max": 30.0,
    }
    assert "allowed are -30 rad/s to 30 rad/s" in str(error)
    with pytest.raises(GatewayError) as refused:
        gateway.arm(20)
    assert refused.value.name in ("UnknownAxis", "NotConfigured")
    assert refused.value.fields["axis"] == 20


def test_what_is_left_from_before_a_stop_is_refused(gateway: Gateway) -> None:
    before = gateway.arm(0)
    before.set(make_velocity(0, 1.0))
    before.disarm()
    gateway.wait_until_stopped(0)
    with gateway.arm(0) as motors:
        with pytest.raises(GatewayError) as refused:
            before.set(make_velocity(0, 1.0))
        assert refused.value.name == "StaleEpoch"
        assert refused.value.fields["current"] == motors.epoch


def test_stop_estop_and_clear(gateway: Gateway) -> None:
    with gateway.arm(0, 2) as motors:
        motors.cycle([make_velocity(0, 1.0), make_velocity(2, 1.0)])
        gateway.stop(0)
        [zero] = gateway.wait_until_stopped(0)
        assert zero.state == "holding"
        motors.set(make_velocity(2, 1.0))
        assert gateway.state(2).state == "active"
        gateway.estop()
    gateway.wait_until_stopped(2)
    two = gateway.state(2)
    assert two.state == "tripped" and two.trip is not None and two.trip.reason == "e_stop"
    with pytest.raises(GatewayError) as refused:
        gateway.arm(2)
    assert refused.value.name in ("EStopped", "Tripped")
    gateway.clear()
    gateway.clear(2)
    with gateway.arm(2) as motors:
        motors.set(make_velocity(2, 1.0))
    gateway.wait_until_stopped(2)


def test_events_tell_what_happened(gateway: Gateway) -> None:
    while gateway.event():
        pass
    with gateway.arm(0) as motors:
        motors.set(make_velocity(0, 1.0))
        gateway.pause(0.3)
    told = []
    while event := gateway.event(timeout=0.01):
        told.append(event)
    [trip] = [event for event in told if event.name == "tripped"]
    assert trip.axis == 0 and trip.fields["trip"]["reason"] == "setpoint_expired"
    assert [event.time_us for event in told] == sorted(event.time_us for event in told)


def test_times_and_names_that_make_no_sense_are_told(gateway: Gateway) -> None:
    with gateway.arm(0) as motors:
        for wrong, word in [(-1.0, "-1"), (math.nan, "NaN"), (math.inf, "inf")]:
            with pytest.raises(UsageError, match=f"seconds from 0 on, not {word}"):
                motors.set(make_velocity(0, 1.0), ttl=wrong)
        with pytest.raises(GatewayError, match="allowed are 0 µs to 100000 µs") as too_long:
            motors.set(make_velocity(0, 1.0), ttl=2**32 / 1e6 + 0.05)
        assert too_long.value.name == "OutOfRange"
        with pytest.raises(UsageError, match="`speed` is no field; there are position, velocity"):
            motors.cycle([make_velocity(0, 1.0)], fields=["speed"])
        with pytest.raises(UsageError) as refused:
            motors.cycle([make_velocity(0, 1.0), make_velocity(0, 2.0)])
        assert refused.value.name == "NamedTwice"
        twice: List[Callable[[], Any]] = [
            lambda: motors.hold([make_velocity(0, 1.0)] * 2, 0.1),
            lambda: gateway.arm(0, 0),
            lambda: gateway.run_cycle(0, 0),
        ]
        for act in twice:
            with pytest.raises(UsageError, match="axis 0 is named twice: name each axis of a req"):
                act()
        for short, word in [(0, "0"), (1e-9, "0.000000001")]:
            asked: List[Callable[[], Any]] = [
                lambda: motors.set(make_velocity(0, 1.0), ttl=short),
                lambda: motors.cycle([make_velocity(0, 1.0)], ttl=short),
                lambda: motors.hold([make_velocity(0, 1.0)], 0.1, ttl=short),
                lambda: motors.move(0, 1.0, 1.0, ttl=short),
                lambda: motors.native(0, "torque_current", current_a=0.1, ttl=short),
            ]
            for act in asked:
                with pytest.raises(UsageError, match=f"a ttl is 0.000001 s or more, not {word}"):
                    act()
        with pytest.raises(UsageError, match=r"a list of names such as \['position'\], not 'vel"):
            motors.cycle([make_velocity(0, 1.0)], fields="velocity")
        none: Dict[str, Callable[[], Any]] = {
            "cycle takes 1 to 16 setpoints": lambda: motors.cycle([]),
            "hold takes 1 to 32 setpoints": lambda: motors.hold([], 0.1),
            "run_cycle takes 1 to 16 axes": gateway.run_cycle,
            "subscribe takes 1 to 32 axes": gateway.subscribe,
        }
        for text, act in none.items():
            with pytest.raises(UsageError, match=f"{text}, not 0"):
                act()
    for number in (-1, 32, 256, 10**30, True, 1.0, "0", None):
        acts: List[Callable[[Any], Any]] = [
            gateway.state, gateway.arm, gateway.run_cycle, lambda axis: make_velocity(axis, 1.0),
        ]
        if number is not None:
            acts += [gateway.stop, gateway.clear]
        for refuse in acts:
            with pytest.raises(UsageError, match="an axis is a number from 0 to 31, not ") as told:
                refuse(number)
            assert str(told.value).endswith(f"not {number!r}")
    with pytest.raises(UsageError, match="1 to 16 axes, not 0"):
        gateway.arm()


def test_a_closed_session_says_so() -> None:
    gateway = Simulator().connect(FOUR_MOTORS)
    gateway.close()
    gateway.close()
    assert gateway.closed
    with pytest.raises(ClosedError):
        gateway.state(0)


def test_two_sessions_share_a_simulation_and_one_commands(simulator: Simulator) -> None:
    with simulator.connect(FOUR_MOTORS) as one, simulator.connect() as other:
        with one.arm(0):
            with pytest.raises(GatewayError) as refused:
                other.arm(2)
            assert refused.value.name == "NotInCommand"
            assert other.state(0).state == "armed"
            other.stop(0)
        one.wait_until_stopped(0)
    with simulator.connect() as third:
        assert third.info()["board"] == "simulated"
