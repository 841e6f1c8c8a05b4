"""A simulation in virtual time, and one in real time that other processes reach."""

from __future__ import annotations

from dataclasses import replace
from typing import Iterator

import pytest

from motor_gateway import FOUR_MOTORS, Gateway, Simulator

#: How long a setpoint may be valid, and the host be silent, in real time.
SERVED_TTL_US = 1_000_000


@pytest.fixture
def simulator() -> Simulator:
    return Simulator()


@pytest.fixture
def gateway(simulator: Simulator) -> Iterator[Gateway]:
    with simulator.connect(FOUR_MOTORS) as gateway:
        yield gateway


@pytest.fixture
def served() -> Simulator:
    """In real time, configured by a session that has ended; patient, as the machine may be busy."""
    simulator = Simulator(real_time=True)
    axes = [replace(axis, ttl_us=SERVED_TTL_US) for axis in FOUR_MOTORS.axes]
    gateway = replace(FOUR_MOTORS.gateway, link_silence_us=SERVED_TTL_US)
    simulator.connect(replace(FOUR_MOTORS, axes=axes, gateway=gateway)).close()
    return simulator
