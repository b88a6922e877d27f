"""Flights with faults, for the study of fault detection: a simulator that shares no sensor model with the product.

    from fti.study.faults import CELLS, draw

    flight = draw(CELLS[0], seed=1)
    for t_ns, device, measurement in flight:
        ...

``Cell`` says what is wrong, how much, and with which inertial unit; ``Flight`` iterates over the measurements of all
devices in order of time, and knows the truth (``truth``, ``error``) and the fault (``fault``).
Earth, motion, inertial units and receivers are written anew from published formulas; only ``fti.types`` is common.
"""

from __future__ import annotations

from fti.study.faults.cells import CELLS, Cell, Kind
from fti.study.faults.flight import START_NS, Fault, Flight, draw

__all__ = ["CELLS", "START_NS", "Cell", "Fault", "Flight", "Kind", "draw"]
