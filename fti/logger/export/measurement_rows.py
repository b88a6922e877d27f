"""Rows of decoded measurements: equal to those of the same measurements in a derived file, without JSON between."""

from __future__ import annotations

import json
import math
from operator import attrgetter
from typing import Any

from fti.logger.encoding import encode
from fti.logger.export.columns import Column, Type, types_of_class
from fti.logger.export.units import unit_of
from fti.logger.reading.json_message import parse_json
from fti.messages.measurements import Measurement


class MeasurementRows:
    """Columns and rows of a class of measurements on a topic."""

    def __init__(self, topic: str, kind: type) -> None:
        types = types_of_class(kind)
        self.columns = [Column(name, type_, unit_of(topic, name)) for name, type_ in types.items()]
        vectors: dict[str, int] = {}  # number of components of each vector, by its name
        for name in types:
            whole, _, component = name.rpartition(".")
            if component.isdigit():
                vectors[whole] = int(component) + 1
        paths = dict.fromkeys(path if (path := name.rpartition(".")[0]) in vectors else name for name in types)
        self._values = attrgetter(*paths)
        # from the last to the first, so that a vector that becomes its components moves no other one
        self._vectors = [(n, vectors[path]) for n, path in reversed([*enumerate(paths)]) if path in vectors]
        self._floats = [n for n, type_ in enumerate(types.values()) if type_ is Type.FLOAT]
        self._texts = [n for n, type_ in enumerate(types.values()) if type_ is Type.TEXT]

    def cells(self, measurement: Measurement) -> list[Any]:
        """The values of the columns; None for unknown ones and for numbers that are not finite."""
        cells = list(self._values(measurement))
        for n, size in self._vectors:
            cells[n : n + 1] = cells[n] or (None,) * size
        for n in self._floats:
            if (value := cells[n]) is not None:
                cells[n] = float(value) if math.isfinite(value) else None
        for n in self._texts:
            if not isinstance(cells[n], str | None):
                cells[n] = json.dumps(parse_json(encode(cells[n])))
        return cells
