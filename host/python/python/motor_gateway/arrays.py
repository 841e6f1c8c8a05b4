"""States and samples as record arrays of numpy, which only this module needs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, List, Sequence, Union

from . import _native
from ._native import CyclePeriod, CycleState
from .readings import Sample

if TYPE_CHECKING:
    import numpy
    import numpy.typing

    Records = numpy.typing.NDArray[numpy.void]

_READINGS = ("position_rad", "velocity_rad_s", "current_a", "voltage_v", "motor_temperature_c",
             "driver_temperature_c")
# As state_records in Rust writes them.
_STATE: List[Any] = [
    ("axis", "u1"), ("state", "u1"), ("answered", "?"), ("_", "u1"), ("age_us", "<u4"),
    *((name, "<f4") for name in _READINGS),
    ("faults_raw", "<i4"),
]
# As period_records does.
_PERIOD: List[Any] = [
    ("time_us", "<u8"), ("period", "<u4"), ("late_us", "<u4"), ("jitter_us", "<u4"),
    ("took_us", "<u4"), *_STATE,
]
_SAMPLE: List[Any] = [
    ("time_us", "<u8"), ("axis", "u1"), ("state", "u1"),
    *((name, "<f4") for name in _READINGS),
    ("faults_raw", "<i4"),
]


#: What :func:`as_array` takes.
Items = Union[Sequence[CycleState], Sequence[CyclePeriod], Sequence[Sample]]


def as_array(items: Items) -> Records:
    """States of cycles, periods of a free-running cycle or samples as one record array.

    A record for each axis, its fields named as the attributes: ``array["position_rad"]``. A
    period's stand in the record of each of its axes. ``state`` is a place in
    :data:`motor_gateway.STATES`; what is missing is NaN, or -1 of ``faults_raw``.

    :raises ImportError: numpy is not installed.
    """
    import numpy

    records: Records
    states = [one for one in items if isinstance(one, CycleState)]
    periods = [one for one in items if isinstance(one, CyclePeriod)]
    if states:
        data = _native.state_records(states)
        records = numpy.frombuffer(data, dtype=numpy.dtype(_STATE))
    elif periods:
        data = _native.period_records(periods)
        records = numpy.frombuffer(data, dtype=numpy.dtype(_PERIOD))
    else:
        samples = [_sample(one) for one in items if isinstance(one, Sample)]
        records = numpy.array(samples, dtype=numpy.dtype(_SAMPLE))
    return records


def _sample(sample: Sample) -> Any:
    def value(name: str) -> float:
        reading = getattr(sample, name)
        return float("nan") if reading is None else float(reading.value)

    return (
        sample.time_us,
        sample.axis,
        _native.STATES.index(sample.state),
        *(value(name) for name in _READINGS),
        -1 if sample.faults_raw is None else sample.faults_raw,
    )
