"""What can go wrong. Every exception of this package is a :class:`MotorGatewayError`."""

from __future__ import annotations

import sys
from typing import Any, Dict, Optional, Type


class MotorGatewayError(Exception):
    """Why a call has no result.

    ``name`` is one that programs can rely on, ``number`` that of the gateway's error if it is one
    of the gateway, ``fields`` its data: names and values in snake_case, as ``mgw --json`` prints
    them.
    """

    name: str
    number: Optional[int]
    fields: Dict[str, Any]

    def __init__(
        self,
        message: str,
        name: str = "",
        number: Optional[int] = None,
        fields: Optional[Dict[str, Any]] = None,
    ) -> None:
        super().__init__(message)
        self.name = name or type(self).__name__
        self.number = number
        self.fields = fields or {}

    def __reduce__(self) -> Any:
        return (type(self), (str(self), self.name, self.number, self.fields))


class GatewayError(MotorGatewayError):
    """The gateway refused it, or could not do it."""


class LinkError(MotorGatewayError):
    """The gateway cannot be reached, does not answer, or answers what nobody understands."""


class StopUnansweredError(LinkError):
    """A stop was sent again and again, and nothing answered.

    The gateway stops the motors when it no longer hears this program. Cut their power if they
    turn.
    """


class InterruptedCallError(MotorGatewayError):
    """A stop, or the end of the session, ended this call; what was armed has been stopped."""


class ClosedError(MotorGatewayError):
    """The session has ended, or belongs to another process."""


class UsageError(MotorGatewayError, ValueError):
    """What was asked for makes no sense."""


class ConfigurationError(MotorGatewayError, ValueError):
    """Everything that is wrong with a configuration, in ``fields["findings"]``."""


_LINK = ("NoAnswer", "Incompatible", "UnreadableReply", "BaudFailed", "LinksTaken", "NoConnection",
         "ConnectionLost", "Port")
_CLASSES: Dict[str, Type[MotorGatewayError]] = {
    "StopUnanswered": StopUnansweredError,
    "Interrupted": InterruptedCallError,
    "Closed": ClosedError,
    "Forked": ClosedError,
    "Reentered": InterruptedCallError,
    "Usage": UsageError,
    "NamedTwice": UsageError,
    "NoSuchAxis": UsageError,
    "TooLong": UsageError,
    "Refused": UsageError,
    "Configuration": ConfigurationError,
}


def make(
    name: str, message: str, number: Optional[int], fields: Optional[Dict[str, Any]]
) -> MotorGatewayError:
    """The exception for a failure: called by the part in Rust."""
    kind = _kind(name, number, fields or {})
    made = kind(message, name, number, fields)
    # What Rust raises has no context of itself: a stop that nothing answers would hide why its
    # block was left.
    made.__context__ = sys.exc_info()[1]
    return made


def _kind(name: str, number: Optional[int], fields: Dict[str, Any]) -> Type[MotorGatewayError]:
    if number is not None:
        return GatewayError
    if "field" in fields:
        return UsageError
    if "findings" in fields:
        return ConfigurationError
    if name in _LINK:
        return LinkError
    return _CLASSES.get(name, MotorGatewayError)
