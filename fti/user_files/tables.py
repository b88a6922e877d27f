"""The tables of each file that a user writes, found in the classes with which the file is read."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, get_args, get_origin

from fti import drivers
from fti.config import Config, StrictModel
from fti.config.keys import Key, keys_of
from fti.drivers.arinc429.labels import LabelSet
from fti.hil.sensors import MODELS, SETTINGS
from fti.hil.tables.schema import Scenario, SensorSettings
from fti.nav.integrity.approach import Airfield
from fti.nav.integrity.reference import ReferenceHeader

#: Keys of other files, or with a page of their own.
ELSEWHERE = ("fault",)


@dataclass(frozen=True, slots=True)
class Table:
    """A table of a file.

    head  : its line in the file, "[session]"; "" for the keys at the top of the file
    kind  : value of its key ``kind``, which selects the class; "" for a table without one
    title : what distinguishes tables of the same head and no kind
    """

    head: str
    model: type[StrictModel]
    kind: str = ""
    title: str = ""

    @property
    def keys(self) -> tuple[Key, ...]:
        """The keys; with a title only those that the class itself defines."""
        keys = keys_of(self.model)
        return tuple(key for key in keys if key.name in self.model.__annotations__) if self.title else keys

    @property
    def description(self) -> str:
        """What the table is; of settings of device models with the drivers that they belong to."""
        text = (inspect.getdoc(self.model) or "").replace("``", "`")
        text = text.removeprefix(f"`{self.head}`: ")
        if self.title:
            text += f"\n\nOf devices with the drivers {', '.join(sensor_settings()[self.model])}."
        return text[:1].upper() + text[1:]


def configuration() -> list[Table]:
    """Tables of a configuration, without the options of drivers."""
    return list(_tables(Config, "", False))


def driver_options(name: str) -> list[Table]:
    """Tables of the options of a driver; empty without options."""
    return [table for table in _tables(drivers.load(name).Options, "device.options", False) if table.keys]


def label_sets() -> list[Table]:
    """Tables of a file of ARINC 429 label sets."""
    return list(_tables(LabelSet, "NAME", False))


def airfield() -> list[Table]:
    """Tables of an airfield file."""
    return list(_tables(Airfield, "", False))


def reference_header() -> list[Table]:
    """Tables of the header of an approach reference, without the airfield."""
    return [table for table in _tables(ReferenceHeader, "", False) if "airfield" not in table.head]


def scenario() -> list[Table]:
    """Tables of a scenario, without its faults; the settings of devices after those of all devices."""
    found = []
    for table in _tables(Scenario, "", False):
        found.append(table)
        if table.model is SensorSettings:
            found += [Table(table.head, model, title=_first_line(model)) for model in sensor_settings()]
    return found


def sensor_settings() -> Mapping[type[StrictModel], list[str]]:
    """The classes of settings of device models, each with its drivers."""
    found: dict[type[StrictModel], list[str]] = {}
    for driver in sorted(MODELS):
        for model in SETTINGS[driver].__mro__ if driver in SETTINGS else ():
            if issubclass(model, SensorSettings) and model is not SensorSettings and model.__annotations__:
                found.setdefault(model, []).append(driver)
    return found


def _first_line(model: type[StrictModel]) -> str:
    return (inspect.getdoc(model) or "").partition("\n")[0].rstrip(".")


def _tables(model: type[StrictModel], path: str, is_list: bool) -> Iterator[Table]:
    """The table of a model and those below it."""
    brackets = "[[{}]]" if is_list else "[{}]"
    yield Table(brackets.format(path) if path else "", model, _kind(model))
    for name, field in model.model_fields.items():
        if name in ELSEWHERE:
            continue
        for inner, suffix, inner_is_list in _models(field.annotation):
            yield from _tables(inner, f"{path}.{name}".lstrip(".") + suffix, inner_is_list)


def _kind(model: type[StrictModel]) -> str:
    """The value of ``kind`` if it selects the class."""
    field = model.model_fields.get("kind")
    values = get_args(field.annotation) if field is not None and field.description is None else ()
    return str(values[0]) if values else ""


def _models(annotation: Any) -> Iterator[tuple[type[StrictModel], str, bool]]:
    """The models in the annotation of a key, with the rest of their path, and whether they are in a list."""
    if inspect.isclass(annotation) and issubclass(annotation, StrictModel):
        yield annotation, "", False
        return
    origin = get_origin(annotation)
    for part in get_args(annotation)[-1:] if _is_mapping(origin) else get_args(annotation):
        for model, suffix, is_list in _models(part):
            yield model, ".NAME" + suffix if _is_mapping(origin) else suffix, is_list or origin is tuple


def _is_mapping(origin: Any) -> bool:
    return inspect.isclass(origin) and issubclass(origin, Mapping)
