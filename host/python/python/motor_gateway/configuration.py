"""The configuration of a gateway as dataclasses: the keys of a configuration file.

Made by configuration_classes.py from the tables of the gateway's parameters; do not edit.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any, Dict, List, Literal, Optional, Sequence, Union



@dataclass
class GatewaySettings:
    """What holds for the gateway as a whole."""

    #: Without a valid request from the host in command for this long, every axis stops. [µs] 50000
    #: to 10000000. Default 250000.
    link_silence_us: Optional[int] = None
    #: Name of the gateway, for use instead of its number.
    name: Optional[str] = None


@dataclass
class Bus:
    """A bus."""

    #: Number of the bus; with --merge also its name. 0 to 7.
    bus: Union[int, str]
    #: bit/s.
    bitrate: int
    #: What the motors on it speak; nothing where only raw frames are sent.
    protocols: List[Literal["rmd", "thruster", "d5"]]
    #: Every node on it belongs to this gateway. Default False.
    exclusive: Optional[bool] = None
    #: Name of the bus, for use instead of its number.
    name: Optional[str] = None
    #: How long a reply is awaited, µs. 100 to 200000. Default 5000.
    reply_window_us: Optional[int] = None


@dataclass
class Axis:
    """An axis: a motor on a bus, and what it may do."""

    #: Number of the axis; with --merge also its name. 0 to 31.
    axis: Union[int, str]
    #: Number of the bus that the motor is on. 0 to 7.
    bus: Union[int, str]
    #: What the motor speaks: 1 rmd, 2 thruster, 3 d5.
    protocol: Literal["rmd", "thruster", "d5"]
    #: The motor's id on its bus, as its manual counts it. 1 to 253.
    node: int
    #: What a stop does: 1 coast, 2 hold, 3 brake.
    stop_action: Literal["coast", "hold", "brake"]
    #: Lets the axis arm though the motor's own timeout is off, or longer than 60 s. Default False.
    allow_no_motor_timeout: Optional[bool] = None
    #: Lets the motor of an armed axis turn without a setpoint: by hand, by wind or water. Default
    #: False.
    allow_uncommanded: Optional[bool] = None
    #: Lets the axis arm though nothing is known of the motor's own timeout. Default False.
    allow_unknown_motor_timeout: Optional[bool] = None
    #: RMD: what the motor says of its brake (0x9A byte 3) is not believed, as newer firmware does
    #: not tell: an echoed 0x77 counts as released, an echoed 0x78 and 1 s as locked. Default
    #: False.
    allow_unverified_brake: Optional[bool] = None
    #: The largest current, in setpoints and measured. [A] 0.0 to 1000.0.
    current_limit_a: Optional[float] = None
    #: D5: the acknowledge level that the motor is set to. 0 to 2. Default 2.
    d5_ack_level: Optional[int] = None
    #: D5: CAN id of replies, of 11 bits, or with bit 31 set of 29; without it any will do, as the
    #: frame itself names its motor. That a reply has the id of its request is an assumption.
    d5_reply_id: Optional[Union[int, str]] = None
    #: D5: CAN id of requests, of 11 bits, or with bit 31 set of 29, where it is not the number of
    #: the motor as one of 11 bits. The manual gives neither ids nor frame type: that it is this
    #: number is an assumption.
    d5_request_id: Optional[Union[int, str]] = None
    #: −1 turns the sense of rotation around, 1 keeps it; nothing else. Default 1.
    direction: Optional[Literal[-1, 1]] = None
    #: How often the fault word of an armed axis is read. [µs] 20000 to 1000000. Default 100000.
    fault_poll_us: Optional[int] = None
    #: What it needs may be missing; until it is there it cannot be armed. Default False.
    incomplete: Optional[bool] = None
    #: How far beyond a limit a measured value may be before it trips the axis, as a fraction of
    #: the limit, for positions of at least 1 rad. 0.0 to 1.0. Default 0.1.
    limit_margin: Optional[float] = None
    #: Missing replies in a row that trip the axis. 2 to 20. Default 3.
    missed_replies: Optional[int] = None
    #: RMD motion mode: the damping that the upper end of its range stands for. [N·m·s/rad] 0.01 to
    #: 1000.0. Default 5.0.
    motion_damping_nm_s_per_rad: Optional[float] = None
    #: RMD motion mode: the position that the ends of its range stand for, to both sides of zero.
    #: [rad] 0.1 to 1000.0. Default 12.5.
    motion_position_rad: Optional[float] = None
    #: RMD motion mode: the stiffness that the upper end of its range stands for. [N·m/rad] 0.1 to
    #: 10000.0. Default 500.0.
    motion_stiffness_nm_per_rad: Optional[float] = None
    #: RMD motion mode: the torque that the ends of its range stand for, to both sides of zero.
    #: [N·m] 0.1 to 10000.0. Default 24.0.
    motion_torque_nm: Optional[float] = None
    #: RMD motion mode: the velocity that the ends of its range stand for, to both sides of zero.
    #: [rad/s] 0.1 to 1000.0. Default 45.0.
    motion_velocity_rad_s: Optional[float] = None
    #: The motor's own timeout, ms; it is written to the motor. 0 is off.
    motor_timeout_ms: Optional[int] = None
    #: Name of the axis, for use instead of its number.
    name: Optional[str] = None
    #: Thruster protocol: the device has an encoder. Default False.
    position_device: Optional[bool] = None
    #: The highest position, in setpoints and measured. [rad] -1000000.0 to 1000000.0.
    position_max_rad: Optional[float] = None
    #: The lowest position, in setpoints and measured. [rad] -1000000.0 to 1000000.0.
    position_min_rad: Optional[float] = None
    #: How often a setpoint in force is sent to the motor again; at least every third of the
    #: motor's own timeout, every 20 ms where that is unknown, as a D5's is: it can be switched on
    #: and off, and nothing tells how long it is. [µs] 1000 to 1000000. Default 20000.
    refresh_us: Optional[int] = None
    #: Lets arming release a mechanical brake. Default False.
    release_brake_when_arming: Optional[bool] = None
    #: Thruster protocol: bytes 6 and 7 of the VM that the device is set to, as one number. 0: it
    #: echoes; 0x0001 to 0x0007: frames with a header; 0x0200 to 0x0207: one frame without; with
    #: bit 8 it returns nothing and cannot be armed. A native VM that the device takes sets it. 0
    #: to 775. Default 0.
    return_mode: Optional[int] = None
    #: RMD: the version of the protocol that the motor speaks: 0 unknown, 1 v3_6, 2 v3_7 (and 3.8),
    #: 3 v3_9 (to 4.1), 4 v4_2, 5 v4_3, 6 v4_4. Native commands and impedance follow it; unknown
    #: has what all versions have in common. Default v3_6.
    rmd_dialect: Optional[Literal["unknown", "v3_6", "v3_7", "v3_9", "v4_2", "v4_3", "v4_4"]] = None
    #: The largest fraction of the full signal in setpoints. 0.0 to 1.0.
    signal_limit: Optional[float] = None
    #: Up to this speed the motor counts as standing; at least one unit of its reading: 1 °/s of an
    #: RMD and a D5, 1 rpm of a thruster. [rad/s] 0.0 to 10.0. Default 0.105.
    standstill_rad_s: Optional[float] = None
    #: How often the position of the motor is read, and one other value beside it. [µs] 5000 to
    #: 1000000. Default 50000.
    state_poll_us: Optional[int] = None
    #: How often a confirmed stop is repeated while the axis is tripped. [µs] 100000 to 5000000.
    #: Default 500000.
    stop_repeat_us: Optional[int] = None
    #: Unconfirmed stops after which the motor counts as unreachable. 3 to 100. Default 10.
    stops_before_unreachable: Optional[int] = None
    #: Thruster protocol: bytes 5 to 7 of the SR that the device is set to, as one number: 0x10000,
    #: 0x20000 and 0x40000 for the frames 1, 2 and 3 that it sends by itself, plus the milliseconds
    #: between them. The load of the bus counts them; a native SR that the device takes sets it. 0
    #: to 16777215. Default 0.
    stream: Optional[int] = None
    #: The highest temperature of motor or driver. [°C] -40.0 to 200.0.
    temperature_limit_c: Optional[float] = None
    #: RMD of v4_3 and v4_4: with every velocity and position setpoint the motor is told to keep
    #: its torque below this part of its rated current. Above its stall current nothing is capped.
    #: [%] 1 to 255.
    torque_cap_percent: Optional[int] = None
    #: The largest torque, in impedance setpoints and measured. [N·m] 0.0 to 10000.0.
    torque_limit_nm: Optional[float] = None
    #: Axes with the same number trip together, and none of them is armed while another is tripped.
    #: 1 to 32.
    trip_group: Optional[int] = None
    #: How far ahead a setpoint may expire. [µs] 5000 to 60000000. Default 100000.
    ttl_us: Optional[int] = None
    #: Above this speed an armed axis without a setpoint trips; 5 times standstill_rad_s unless
    #: set. [rad/s] 0.0 to 10000.0.
    uncommanded_rad_s: Optional[float] = None
    #: Unsafe: setpoints do not expire; only a silent host link stops the motor. Default False.
    unsafe_infinite_ttl: Optional[bool] = None
    #: The largest speed, in setpoints and measured. [rad/s] 0.0 to 10000.0.
    velocity_limit_rad_s: Optional[float] = None
    #: Thruster protocol: over-voltage, under-voltage and a broken temperature sensor, which the
    #: device only reports, bar arming and trip like its faults. A broken sensor does anyway where
    #: the axis has temperature_limit_c. Default False.
    warnings_are_faults: Optional[bool] = None


@dataclass
class Configuration:
    """Everything that is configured; what is not in it has its default."""

    buses: Sequence[Bus] = ()
    axes: Sequence[Axis] = ()
    gateway: GatewaySettings = field(default_factory=GatewaySettings)

    def to_dict(self) -> Dict[str, Any]:
        """As a dictionary with the keys of a file."""
        return {
            "gateway": _given(self.gateway),
            "bus": [_given(bus) for bus in self.buses],
            "axis": [_given(axis) for axis in self.axes],
        }


def _given(row: Any) -> Dict[str, Any]:
    return {name: value for name, value in asdict(row).items() if value is not None}


#: The configuration of the four motors of a simulator: four-motors.toml.
FOUR_MOTORS = Configuration(
    gateway=GatewaySettings(link_silence_us=250000),
    buses=[
        Bus(bus=0, bitrate=1000000, protocols=["rmd", "thruster"]),
        Bus(bus=1, bitrate=210526, protocols=["d5"]),
        Bus(bus=2, bitrate=115200, protocols=["rmd"]),
    ],
    axes=[
        Axis(axis=0, bus=0, protocol="rmd", node=1, stop_action="hold", velocity_limit_rad_s=30.0,
            motor_timeout_ms=300),
        Axis(axis=1, bus=0, protocol="thruster", node=11, stop_action="coast", signal_limit=0.5,
            motor_timeout_ms=300),
        Axis(axis=2, bus=1, protocol="d5", node=11, stop_action="hold", velocity_limit_rad_s=30.0),
        Axis(axis=3, bus=2, protocol="rmd", node=1, stop_action="hold", velocity_limit_rad_s=30.0,
            motor_timeout_ms=300, ttl_us=500000),
    ],
)
