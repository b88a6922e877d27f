"""Description of every kind of fault: meaning, keys with unit, default and limits, subjects, flags, an example.

Sources: the tables of the scenario file (``fti.hil.tables.fault_types``), the drivers to which a fault applies, and
the flags that the score expects.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, get_args

from fti.config import StrictModel
from fti.config.keys import Key, keys_of, toml_value
from fti.hil.faults.applicability import drivers_of
from fti.hil.oracle.flags_of_kinds import FLAGS, NO_FLAG, KindFlag
from fti.hil.tables import fault_types
from fti.hil.tables.fault_base import DeviceFault, LinkFault, MessageFault, QuantityFault

#: Keys that all faults of devices, or of links, have.
SHARED_KEYS = ("devices", "links", "from_s", "to_s")
#: Subjects of the kinds; the first match counts.
SUBJECTS: tuple[tuple[Any, str], ...] = (
    (fault_types.Obstacle | fault_types.OffTrack | fault_types.TerrainShift, "the world"),
    (fault_types.CanStatus, "CAN links with an slcan adapter"),
    (LinkFault, "CAN links"),
    (QuantityFault, "devices that measure the quantity"),
    (MessageFault, "messages of devices"),
    (fault_types.SwappedCoordinates, "devices that send a latitude and a longitude"),
    (fault_types.Undulation, "devices that send a height above the ellipsoid, or an undulation"),
    (fault_types.LeverArm, "devices that send a position, a velocity or a range"),
    (fault_types.Mounting, "devices that measure a range along a direction"),
    (fault_types.AttitudeOffset, "devices that send the angle"),
    (fault_types.InertialBias, "devices that send the angular rate or the specific force of the axis"),
    (fault_types.Fog, "devices; of these only laser altimeters are affected"),
    (fault_types.PowerFault, "devices, except power units"),
    (DeviceFault, "devices"),
)
#: Devices of configs/demo.toml in the examples of kinds that do not apply to its altimeter.
OTHER_DEVICES: Mapping[fault_types.FaultKind, str] = {
    fault_types.FaultKind.ATTITUDE_OFFSET: "ahrs",
    fault_types.FaultKind.CLOCK_DRIFT: "gnss",
    fault_types.FaultKind.CLOCK_JUMP: "gnss",
    fault_types.FaultKind.FOG: "autopilot",
    fault_types.FaultKind.GNSS_DEGRADED: "gnss",
    fault_types.FaultKind.GNSS_OFFSET: "gnss",
    fault_types.FaultKind.GNSS_OUTAGE: "gnss",
    fault_types.FaultKind.GNSS_RAMP: "gnss",
    fault_types.FaultKind.INERTIAL_BIAS: "ins",
    fault_types.FaultKind.LEVER_ARM: "gnss",
    fault_types.FaultKind.SWAPPED_COORDINATES: "gnss",
    fault_types.FaultKind.UNDULATION: "gnss",
    fault_types.FaultKind.WRONG_CHECKSUM: "gnss",
    fault_types.FaultKind.WRONG_LABEL: "gnss",
}


@dataclass(frozen=True, slots=True)
class FaultDescription:
    """A kind of fault.

    description : the first line is a summary; drivers : to which it applies, None: no restriction
    no_flag     : why it never raises a flag; if it has flags, the condition in which it raises none; or ""
    example     : a [[fault]] table, valid with configs/demo.toml
    """

    kind: str
    description: str
    subject: str
    drivers: tuple[str, ...] | None
    keys: tuple[Key, ...]
    flags: tuple[KindFlag, ...]
    no_flag: str
    example: str

    @property
    def own_keys(self) -> tuple[Key, ...]:
        """The keys without ``SHARED_KEYS``; all keys of a fault of the world."""
        shares = any(key.name in ("devices", "links") for key in self.keys)
        return tuple(key for key in self.keys if not shares or key.name not in SHARED_KEYS)


@cache
def fault_kinds() -> Mapping[str, FaultDescription]:
    """Every kind of fault by its name, in the order of ``FaultKind``."""
    models = {
        kind: model
        for model in get_args(get_args(fault_types.Fault)[0])
        for kind in get_args(model.model_fields["kind"].annotation)
    }
    return {kind.value: _kind(kind, models[kind]) for kind in fault_types.FaultKind}


def _kind(kind: fault_types.FaultKind, model: type[StrictModel]) -> FaultDescription:
    ordered = sorted(keys_of(model), key=lambda key: key.name in SHARED_KEYS)  # its own keys first
    return FaultDescription(
        kind.value,
        inspect.getdoc(model) or "",
        next(text for classes, text in SUBJECTS if issubclass(model, classes)),
        drivers_of(model),
        tuple(ordered),
        FLAGS[kind],
        NO_FLAG.get(kind, "") if FLAGS[kind] else "the daemon does not detect it",
        "\n".join(_example(kind, ordered)),
    )


def _example(kind: fault_types.FaultKind, keys: Iterable[Key]) -> Iterator[str]:
    yield "[[fault]]"
    yield f'kind = "{kind}"'
    for key in keys:
        if key.name == "devices" and kind in OTHER_DEVICES:
            yield f"devices = {toml_value([OTHER_DEVICES[kind]])}"
        elif key.example:
            yield f"{key.name} = {key.example}"
