"""Turns axes by a sine of velocity: all setpoints in one call a round.

    python sine.py PORT SECONDS AXIS…
"""

import math
import sys
import time

from motor_gateway import connect, make_velocity

AMPLITUDE_RAD_S = 2.0
TURN_S = 1.0
ROUND_S = 0.005


def main() -> None:
    port, lasts_s, axes = sys.argv[1], float(sys.argv[2]), [int(axis) for axis in sys.argv[3:]]
    with connect(port) as gateway, gateway.arm(*axes) as motors:
        begin = time.monotonic()
        rounds = answered = 0
        while (now := time.monotonic() - begin) < lasts_s:
            velocity = AMPLITUDE_RAD_S * math.sin(math.tau * now / TURN_S)
            states = motors.cycle([make_velocity(axis, velocity) for axis in axes])
            rounds += 1
            answered += sum(state.answered for state in states)
            time.sleep(max(0.0, begin + rounds * ROUND_S - time.monotonic()))
    print(f"{rounds} rounds of {len(axes)} axes, {answered} answers")


if __name__ == "__main__":
    main()
