"""Configurations as dictionaries, dataclasses and files; native commands and frames in words."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any, Dict

import pytest

import motor_gateway
from motor_gateway import (
    FOUR_MOTORS,
    Axis,
    Bus,
    Configuration,
    ConfigurationError,
    Gateway,
    GatewayError,
    Motor,
    Simulator,
    UsageError,
    decode,
    encode,
    make_velocity,
)

HOME = Path(__file__).parent.parent
EXAMPLE = HOME.parent / "cli" / "examples" / "four-motors.toml"


def test_a_dictionary_a_dataclass_and_the_file_are_the_same(simulator: Simulator) -> None:
    with simulator.connect() as gateway:
        by_file = gateway.configure(EXAMPLE)
        assert by_file.changes > 10 and by_file.motor_timeouts_written == 3
        running = gateway.configuration()
        assert gateway.configure(FOUR_MOTORS) == (0, 0)
        assert gateway.configure(FOUR_MOTORS.to_dict()) == (0, 0)
        assert gateway.configure(running) == (0, 0)
        assert running["axis"][0]["velocity_limit_rad_s"] == 30.0
        assert running["gateway"]["link_silence_us"] == 250_000
        assert [axis["protocol"] for axis in gateway.axes()] == ["rmd", "thruster", "d5", "rmd"]


def test_merge_changes_only_what_it_names(gateway: Gateway) -> None:
    changed = gateway.configure({"axis": [{"axis": 0, "ttl_us": 200_000}]}, merge=True)
    assert changed.changes == 1
    with gateway.arm(0) as motors:
        assert motors.ttl == pytest.approx(0.18)
    gateway.wait_until_stopped(0)
    gateway.output_off(0)
    assert len(gateway.axes()) == 4
    assert gateway.configure(Configuration()).changes > 0
    assert gateway.axes() == []


def test_everything_that_is_wrong_is_told_and_nothing_is_changed(
    gateway: Gateway, tmp_path: Path
) -> None:
    before = gateway.configuration()
    wrong = {
        "bus": [{"bus": 0, "bitrate": 12, "protocols": ["rmd"]}],
        "axis": [{"axis": 0, "bus": 0, "protocol": "rmd", "node": 99, "sto_action": "hold"}],
    }
    with pytest.raises(ConfigurationError) as told:
        gateway.configure(wrong)
    findings = told.value.fields["findings"]
    assert {finding["key"] for finding in findings} >= {"bitrate", "sto_action", "stop_action"}
    assert "stop_action" in str(told.value)
    assert findings[0]["line"] is None and "line" not in str(told.value)
    assert isinstance(told.value, ValueError)
    assert gateway.configuration() == before
    with pytest.raises(UsageError):
        gateway.configure({"bus": object()})
    for number in (math.nan, math.inf):
        limit = {"axis": 0, "velocity_limit_rad_s": number}
        text = f"configuration['axis'][0]['velocity_limit_rad_s'] is a finite number, not {number}"
        with pytest.raises(UsageError, match=re.escape(text)):
            gateway.configure({"axis": [limit]}, merge=True)
    file = tmp_path / "wrong.toml"
    file.write_text("[[bus]]\nbus = 0\nbitrate = 12\nprotocols = ['rmd']\n")
    with pytest.raises(ConfigurationError, match="wrong.toml: line 3, bus 0: "):
        gateway.configure(file)
    with pytest.raises(FileNotFoundError):
        gateway.configure("/no/such/file.toml")


def test_a_refusal_by_the_gateway_itself_has_its_number(gateway: Gateway) -> None:
    with gateway.arm(0), pytest.raises(GatewayError) as refused:
        gateway.configure({"axis": [{"axis": 0, "ttl_us": 200_000}]}, merge=True)
    assert (refused.value.name, refused.value.number) == ("NotIdle", 29)
    assert refused.value.fields == {"axis": 0, "state": "armed", "stop_confirmed": None}


def test_a_refusal_because_of_an_axis_that_holds_names_the_way_out(gateway: Gateway) -> None:
    with gateway.arm(0) as motors:
        motors.set(make_velocity(0, 1.0))
    [state] = gateway.wait_until_stopped(0)
    assert state.state == "holding"
    node: Dict[str, Any] = {"axis": [{"axis": 0, "node": 2}]}
    bitrate: Dict[str, Any] = {"bus": [{"bus": 0, "bitrate": 500_000}]}
    for change in (node, bitrate):
        with pytest.raises(GatewayError, match="switch its motor's output off"):
            gateway.configure(change, merge=True)
    gateway.output_off(0)
    assert gateway.state(0).state == "idle"


def test_a_simulator_with_other_motors() -> None:
    motors = [Motor(0, "rmd", 1), Motor(0, "rmd", 2), Motor(1, "rmd", 3, bitrate=500_000)]
    configuration = Configuration(
        buses=[Bus(0, 1_000_000, ["rmd"]), Bus(1, 500_000, ["rmd"])],
        axes=[
            Axis(place, motor.bus, "rmd", motor.node, "hold", motor_timeout_ms=300)
            for place, motor in enumerate(motors)
        ],
    )
    with Simulator(motors).connect(configuration) as gateway:
        with gateway.arm(0, 1, 2) as armed:
            states = armed.cycle([make_velocity(axis, 1.0) for axis in armed.axes])
            assert all(state.answered for state in states)
    with pytest.raises(ValueError, match="`can` is no protocol; there are rmd, thruster, d5"):
        Simulator([Motor(0, "can", 1)])


def test_the_same_seed_gives_the_same_run() -> None:
    def run(seed: int) -> object:
        simulator = Simulator(seed=seed)
        with simulator.connect(FOUR_MOTORS) as gateway, gateway.arm(0) as motors:
            for _ in range(50):
                states = motors.cycle([make_velocity(0, 2.0)])
            return simulator.now(), repr(states)

    assert run(1)[1] == run(1)[1]  # type: ignore[index]


def test_a_command_of_the_manual_by_its_name(gateway: Gateway) -> None:
    reply = gateway.native(0, "read_status_1")
    assert reply is not None and reply["command"] == "read_status_1" and reply["voltage_v"] == 48
    with pytest.raises(UsageError, match="read_status_1"):
        gateway.native(0, "read_stat_1")
    with pytest.raises(GatewayError) as refused:
        gateway.native(0, "velocity", speed_dps=100.0)
    assert refused.value.name in ("NotArmed", "StaleEpoch")
    with gateway.arm(0) as motors:
        moving = motors.native(0, "velocity", speed_dps=100.0)
        assert moving is not None and moving["command"] == "velocity"
        gateway.pause(0.05)
        velocity = gateway.state(0).velocity_rad_s
        assert velocity is not None and velocity.value > 0.5
    with pytest.raises(GatewayError) as refused:
        gateway.native(9, "read_status_1")
    assert refused.value.name == "NotConfigured"


def test_frames_in_words_and_back() -> None:
    frame = encode("rmd", "torque_current", node=1, current_a=-1.5)
    assert frame == "141#A10000006AFF0000"
    [read] = decode(frame)
    assert (read["protocol"], read["node"], read["command"]) == ("rmd", 1, "torque_current")
    assert read["current_a"] == -1.5
    serial = encode("rmd", "torque_current", node=1, bus="rs485", current_a=1.5)
    assert decode(serial)[0]["current_a"] == 1.5
    assert "error" in decode("no frame")[0]
    assert len(decode("141#9C00000000000000\n141#9A00000000000000")) == 2
    with pytest.raises(UsageError) as refused:
        encode("rmd", "torque_current", node=1, current_a=1e9)
    assert refused.value.fields["field"] == "current_a" and refused.value.fields["max"] > 0
    with pytest.raises(UsageError, match="protocol is rmd or thruster or d5"):
        encode("can", "x")


def test_every_error_can_be_pickled(gateway: Gateway) -> None:
    import pickle

    with pytest.raises(GatewayError) as refused:
        gateway.clear_unreachable(0)
    again = pickle.loads(pickle.dumps(refused.value))
    assert (again.name, again.number, again.fields) == ("NothingToClear", 41, {"axis": 0})
    assert str(again) == str(refused.value)


def test_the_names_of_the_package_are_there() -> None:
    assert all(hasattr(motor_gateway, name) for name in motor_gateway.__all__)
