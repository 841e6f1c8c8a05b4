"""Cycles a second at 8 axes over TCP: this package against the Rust client.

    python bench.py [RUST_BENCH]      RUST_BENCH: the program of examples/bench.rs

The simulated gateway runs in a process of its own, in real time, and its buses bound both.
"""

import subprocess
import sys
import time
from typing import List

from motor_gateway import Axis, Bus, Configuration, Motor, Simulator, connect, make_velocity

AXES = 8
CYCLES = 2_000
BITRATE = 1_000_000


def motors() -> List[Motor]:
    return [Motor(axis // 4, "rmd", axis % 4 + 1) for axis in range(AXES)]


def configuration() -> Configuration:
    return Configuration(
        buses=[Bus(bus, BITRATE, ["rmd"]) for bus in range(2)],
        axes=[
            Axis(place, motor.bus, "rmd", motor.node, "hold", velocity_limit_rad_s=10.0,
                 motor_timeout_ms=1_000)
            for place, motor in enumerate(motors())
        ],
    )


def serve() -> None:
    simulator = Simulator(motors(), real_time=True)
    simulator.connect(configuration()).close()
    print(simulator.port, flush=True)
    sys.stdin.read()


def measure(port: str) -> None:
    took: List[float] = []
    with connect(port) as gateway, gateway.arm(*range(AXES)) as armed:
        setpoints = [make_velocity(axis, 0.5) for axis in range(AXES)]
        begin = time.perf_counter()
        for _ in range(CYCLES):
            before = time.perf_counter()
            states = armed.cycle(setpoints)
            took.append(time.perf_counter() - before)
            assert len(states) == AXES
        rate = CYCLES / (time.perf_counter() - begin)
        armed.disarm()
        gateway.wait_until_stopped(*armed.axes)
    took.sort()
    median, p99 = (1e6 * took[int(part * CYCLES)] for part in (0.5, 0.99))
    print(f"Python: {rate:.0f} cycles/s of {AXES} axes, median {median:.0f} µs, p99 {p99:.0f} µs")


def main() -> None:
    if sys.argv[1:] == ["--serve"]:
        return serve()
    program = [sys.executable, __file__, "--serve"]
    with subprocess.Popen(program, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                          text=True) as served:
        assert served.stdin is not None and served.stdout is not None
        port = served.stdout.readline().strip()
        for _ in range(2):
            for rust in sys.argv[1:]:
                subprocess.run([rust, port, str(AXES), str(CYCLES)], check=True)
            measure(port)
        served.stdin.close()


if __name__ == "__main__":
    main()
