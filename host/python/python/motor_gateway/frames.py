"""Frames of the motors in words, and back: the codecs of the firmware. Needs no gateway."""

from __future__ import annotations

from typing import Any, Dict, List, Optional, Tuple, Union

from . import _native

#: What a field of a command may be given as.
FieldValue = Union[int, float, bool, str]


def encode(
    protocol: str,
    command: str,
    node: Union[int, str, None] = None,
    *,
    bus: Optional[str] = None,
    **values: FieldValue,
) -> str:
    """A frame from the name of a command and its fields, as ``mgw encode``.

    ``protocol`` is rmd, thruster or d5; ``node`` a number or ``"all"``; ``bus`` can or rs485.
    ``mgw encode --protocol rmd --list`` lists the commands.

    >>> encode("rmd", "torque_current", node=1, current_a=-1.5)
    '141#A10000006AFF0000'
    """
    words = [command]
    for name, value in [("node", node), ("bus", bus)]:
        if value is not None:
            words += [f"--{name}", str(value)]
    for name, text in field_words(values):
        words += [f"--{name}", text]
    return _native.encode(protocol, words)


def decode(
    text: str,
    *,
    protocol: str = "auto",
    bus: Optional[str] = None,
    direction: Optional[str] = None,
    dialect: str = "v3_6",
) -> List[Dict[str, Any]]:
    """Captured frames in words, as ``mgw decode --json``: one dictionary for each frame.

    ``text`` holds lines of candump or hexadecimal bytes of a serial line. What cannot be decoded
    has an ``error``.

    >>> decode("141#A10000006AFF0000")[0]["current_a"]
    -1.5
    """
    return _native.decode(text, protocol, bus, direction, dialect)


def field_words(values: Dict[str, FieldValue]) -> List[Tuple[str, str]]:
    """The fields of a command as text."""

    def word(value: FieldValue) -> str:
        return str(value).lower() if isinstance(value, bool) else str(value)

    return [(name, word(value)) for name, value in values.items()]
