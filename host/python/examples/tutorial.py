"""From nothing to eight lines that turn a motor, cell by cell.

Run it as it is (`python tutorial.py`), or cell by cell in an editor that knows `# %%`. It needs no
board: the gateway in it is the firmware's own code with four simulated motors, in virtual time.
With a board, `connect("/dev/ttyACM0")` takes the place of `simulator.connect()`.
"""

# %% A gateway with four motors. It is configured as a file, a dictionary or dataclasses say.
from motor_gateway import (
    FOUR_MOTORS,
    Axis,
    Bus,
    Configuration,
    ConfigurationError,
    Gateway,
    GatewayError,
    Simulator,
    as_array,
    decode,
    encode,
    make_position,
    make_signal,
    make_velocity,
)

simulator = Simulator()
gateway = simulator.connect()
print("board:", gateway.info()["board"], "axes:", gateway.axes())

mine = Configuration(
    buses=[Bus(0, bitrate=1_000_000, protocols=["rmd", "thruster"])],
    axes=[
        Axis(0, bus=0, protocol="rmd", node=1, stop_action="hold", velocity_limit_rad_s=30.0,
             motor_timeout_ms=300),
        Axis(1, bus=0, protocol="thruster", node=0x0B, stop_action="coast", motor_timeout_ms=300),
    ],
)
print("changes:", gateway.configure(mine).changes)

# %% What is wrong with a configuration is told all at once, and nothing is changed.
try:
    gateway.configure({"bus": [{"bus": 0, "bitrate": 12, "protocols": ["rmd"]}]})
except ConfigurationError as error:
    print(error)
    assert error.fields["findings"][0]["key"] == "bitrate"
gateway.configure(FOUR_MOTORS)

# %% Nothing moves unless it is armed, and no longer than setpoints keep coming.
with gateway.arm(0) as motors:
    print("armed; a setpoint is valid for", motors.ttl, "s")
    motors.hold([make_velocity(0, 2.0)], 0.5)
    print(gateway.state(0).velocity_rad_s)
[state] = gateway.wait_until_stopped(0)
print("after the block:", state.state)
assert state.trip is None

# %% Who says nothing any more, is stopped: here nobody speaks for half a second.
with gateway.arm(0) as motors:
    motors.set(make_velocity(0, 2.0))
    gateway.pause(0.5)
    tripped = gateway.state(0)
    assert tripped.trip is not None
    print("tripped:", tripped.trip.reason, "at", tripped.trip.velocity_rad_s, "rad/s")
gateway.wait_until_stopped(0)
gateway.clear(0)

# %% All axes in one call, and all their states back: what a control loop needs once a round.
with gateway.arm(0, 1, 2) as motors:
    target = 1.0
    for _ in range(400):
        states = motors.cycle(
            [make_position(0, target, 4.0), make_signal(1, 0.1), make_velocity(2, -1.0)]
        )
    for one in states:
        print(one)
    assert abs((states[0].position_rad or 0.0) - target) < 0.02

# %% Refusals are exceptions with the gateway's name, number and numbers.
gateway.wait_until_stopped(0, 1, 2)
with gateway.arm(0) as motors:
    try:
        motors.set(make_velocity(0, 99.0))
    except GatewayError as error:
        print(error.name, error.number, error.fields)
        assert error.fields["max"] == 30.0

# %% The gateway's own cycle: it sends in a period of its own, and tells of each.
gateway.wait_until_stopped(0)
with gateway.arm(0, 2) as motors, gateway.run_cycle(0, 2, period_s=0.005) as cycle:
    told = []
    for period in cycle:
        if period.period % 10 == 0:
            motors.cycle([make_velocity(0, 2.0), make_velocity(2, 2.0)])
        told.append(period)
        if len(told) == 200:
            break
print(told[-1], "jitter", told[-1].jitter_us, "µs, overruns", told[-1].overruns)

# %% As record arrays, where numpy is installed.
try:
    records = as_array(told)
    of_axis_0 = records[records["axis"] == 0]
    print("mean velocity:", of_axis_0["velocity_rad_s"][100:].mean())
except ImportError:
    print("without numpy:", sum(one.states[0].velocity_rad_s or 0.0 for one in told[100:]) / 100)

# %% Commands of the motor's own manual, by name; frames in words and back.
gateway.wait_until_stopped(0)
print(gateway.native(0, "read_status_1"))
frame = encode("rmd", "torque_current", node=1, current_a=-1.5)
print(frame, decode(frame)[0])

# %% Events tell what happened meanwhile.
while event := gateway.event():
    if event.name == "tripped":
        print(event.time_us, event.name, event.axis, event.fields["trip"]["reason"])

# %% Faults can be put into a simulation.
gateway.wait_until_stopped(0, 2)
with gateway.arm(0) as motors:
    simulator.fault("motor 0 mute")
    answered = [motors.cycle([make_velocity(0, 1.0)])[0].answered for _ in range(3)]
    print("a motor that says nothing:", answered)
simulator.fault("motor 0 mute off")

# %% A `with` block around the session stops all of it, however it is left.
gateway.close()


def turn(session: Gateway) -> None:
    session.arm(3).set(make_velocity(3, 1.0))
    raise RuntimeError("a mistake in your own code")


try:
    with simulator.connect() as gateway:
        turn(gateway)
except RuntimeError as error:
    print("left by:", error)
with simulator.connect() as gateway:
    [state] = gateway.wait_until_stopped(3)
    print("axis 3 is", state.state)
    assert state.trip is None
