"""A simulated gateway with its motors, in this process."""

from __future__ import annotations

from typing import Any, Dict, List, NamedTuple, Optional, Sequence

from . import _native
from .gateway import ConfigurationLike, Gateway


class Motor(NamedTuple):
    """A motor of a simulation, as it comes from its box."""

    bus: int
    #: rmd, thruster or d5.
    protocol: str
    node: int
    #: Where it is not the usual one, bit/s.
    bitrate: Optional[int] = None


class Simulator:
    """A gateway that is the firmware's own code, with simulated buses and motors.

    In virtual time (the default) time passes while a call waits and while :meth:`advance` runs,
    and never else: a run is the same each time, and as fast as the computer can. With
    ``real_time`` it passes by itself, and :attr:`port` is a TCP port that other programs reach
    too.

    Without ``motors`` it has four: RMD 1 and thruster 0x0B on bus 0, D5 0x0B on bus 1, RMD 1 on
    bus 2 (RS485). :data:`motor_gateway.FOUR_MOTORS` is their configuration.
    """

    def __init__(
        self,
        motors: Optional[Sequence[Motor]] = None,
        *,
        real_time: bool = False,
        seed: int = 1,
    ) -> None:
        wanted = None if motors is None else [(*motor,) for motor in motors]
        self._native = _native.Simulation(wanted, real_time, seed)

    @property
    def port(self) -> Optional[str]:
        """``tcp:HOST:PORT`` in real time, None in virtual time."""
        return self._native.port

    def connect(self, configuration: Optional[ConfigurationLike] = None) -> Gateway:
        """A session with it, which makes ``configuration`` that of the gateway if there is one."""
        gateway = Gateway(self._native.connect(), self)
        try:
            if configuration is not None:
                gateway.configure(configuration)
        except BaseException:
            gateway.close()
            raise
        return gateway

    def advance(self, duration_s: float) -> None:
        """Lets virtual time pass, in which no host says anything."""
        self._native.advance(duration_s)

    def now(self) -> float:
        """Time since it began, s."""
        return self._native.now()

    def fault(self, line: str) -> str:
        """Puts a fault into it, or takes it out: what can be typed into ``mgw sim``.

        For example ``"motor 0 mute"``, ``"bus 0 cut"``, ``"e-stop press"``; ``"help"`` raises a
        UsageError that lists them all.
        """
        return self._native.fault(line)

    def motors(self) -> List[Dict[str, Any]]:
        """What each motor does and has logged, past the gateway: the proof that it stopped."""
        return self._native.motors()
