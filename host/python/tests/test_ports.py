"""The ways to a gateway: TCP, a server's socket, a serial device; and one that leads nowhere."""

from __future__ import annotations

import gc
import os
import select
import socket
import threading
from pathlib import Path
from typing import Callable, Iterator, List

import pytest

from motor_gateway import (
    FOUR_MOTORS,
    LinkError,
    Simulator,
    StopUnansweredError,
    UsageError,
    connect,
    make_velocity,
)


def relay(near: int, far: socket.socket) -> None:
    """Carries bytes between a descriptor and a socket until one of them ends."""
    ends = [near, far.fileno()]
    try:
        while True:
            for one in select.select(ends, [], [])[0]:
                data = os.read(one, 4_096)
                if not data:
                    return
                os.write(ends[1] if one == near else near, data)
    except (OSError, ValueError):
        # Closed under it.
        return


def to(served: Simulator) -> socket.socket:
    assert served.port is not None
    _, host, number = served.port.split(":")
    return socket.create_connection((host, int(number)))


def turn(port: str) -> None:
    with connect(port) as gateway, gateway.arm(0) as motors:
        for _ in range(10):
            [state] = motors.cycle([make_velocity(0, 1.0)])
        assert state.answered


def test_tcp_and_the_variable(served: Simulator, monkeypatch: pytest.MonkeyPatch) -> None:
    assert served.port is not None
    turn(served.port)
    monkeypatch.setenv("MGW_PORT", served.port)
    with connect() as gateway:
        assert gateway.info()["board"] == "simulated"


def test_a_session_keeps_its_simulation() -> None:
    with Simulator(real_time=True).connect(FOUR_MOTORS) as gateway:
        gc.collect()
        assert gateway.info()["board"] == "simulated"


@pytest.fixture
def socket_path(served: Simulator, tmp_path: Path) -> Iterator[Path]:
    path = tmp_path / "mgw.sock"
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(path))
        listener.listen()

        def accept() -> None:
            near, _ = listener.accept()
            with near, to(served) as far:
                relay(near.fileno(), far)

        thread = threading.Thread(target=accept, daemon=True)
        thread.start()
        yield path


def test_the_socket_of_a_server(
    socket_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("MGW_PORT", raising=False)
    monkeypatch.setenv("MGW_SOCKET", str(socket_path))
    with connect() as gateway, gateway.arm(0) as motors:
        motors.set(make_velocity(0, 1.0))


def test_a_serial_device(served: Simulator) -> None:
    near, device = os.openpty()
    try:
        with to(served) as far:
            threading.Thread(target=relay, args=(near, far), daemon=True).start()
            turn(os.ttyname(device))
    finally:
        os.close(device)
        os.close(near)


def test_what_leads_nowhere_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(UsageError, match="is no TCP port"):
        connect("tcp:nowhere")
    with pytest.raises(LinkError) as told:
        connect("/dev/no-such-gateway")
    assert "/dev/no-such-gateway" in str(told.value)
    with socket.create_server(("127.0.0.1", 0)) as listener:
        free = listener.getsockname()[1]
    with pytest.raises(LinkError, match="Nothing listens there"):
        connect(f"tcp:127.0.0.1:{free}")
    with socket.create_server(("127.0.0.1", 0)) as deaf:
        with pytest.raises(LinkError) as told:
            connect(f"tcp:127.0.0.1:{deaf.getsockname()[1]}")
        assert told.value.name == "NoAnswer"


def test_a_stop_over_a_lost_connection_is_one_that_nothing_answers(served: Simulator) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener, to(served) as far:
        gateways = []
        port = f"tcp:127.0.0.1:{listener.getsockname()[1]}"
        opening = threading.Thread(target=lambda: gateways.append(connect(port)))
        opening.start()
        near, _ = listener.accept()
        threading.Thread(target=relay, args=(near.fileno(), far), daemon=True).start()
        opening.join()
        [gateway] = gateways
        gateway.arm(0).set(make_velocity(0, 1.0))
    near.shutdown(socket.SHUT_RDWR)
    with pytest.raises(LinkError):
        gateway.axes()
    stops: List[Callable[[], None]] = [lambda: gateway.stop(0), gateway.stop, gateway.close]
    for stop in stops:
        with pytest.raises(StopUnansweredError, match="could not be sent.*Cut their power"):
            stop()
    near.close()


def test_a_gateway_that_is_lost_is_told(served: Simulator) -> None:
    with connect(served.port) as gateway:
        gateway.axes()
        served.fault("power off")
        with pytest.raises(LinkError) as told:
            gateway.axes()
        assert told.value.name == "NoAnswer" and told.value.number is None
        served.fault("power on")
