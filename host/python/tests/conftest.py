"""A simulation in virtual time, and one in real time that other processes reach."""

from __future__ import annotations

from typing import Iterator

import pytest

from motor_gateway import FOUR_MOTORS, Gateway, Simulator


@pytest.fixture
def simulator() -> Simulator:
    return Simulator()


@pytest.fixture
def gateway(simulator: Simulator) -> Iterator[Gateway]:
    with simulator.connect(FOUR_MOTORS) as gateway:
        yield gateway


@pytest.fixture
def served() -> Simulator:
    """In real time, configured by a session that has ended."""
    simulator = Simulator(real_time=True)
    simulator.connect(FOUR_MOTORS).close()
    return simulator
