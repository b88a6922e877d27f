"""Plan of the nominal flights and of the faults that branch off each."""

from __future__ import annotations

import numpy as np

from fti.study.faults.cells import CELLS, SensorFault
from fti.study.faults.detectability import is_detectable
from fti.study.faults.experiment import HOUR_S, AircraftGroup, FlightTask

FAULTS_PER_FLIGHT = 12
#: Divisor of the number of faults of cells outside the table.
OTHER_CELLS_DIVISOR = 11


def plan(runs: int, seed: int, duration_s: float = HOUR_S) -> list[FlightTask]:
    """``runs`` faults of each cell of the table, an eleventh of that (at least one) of others, twelve to a flight.

    Terrains follow each other from flight to flight, ten of them; groups of aircraft take turns.
    """
    rng = np.random.default_rng([seed, 2])
    by_group = dict[AircraftGroup, list[int]]()
    for index, cell in enumerate(CELLS):
        if cell.kind is not SensorFault.NONE:
            count = runs if is_detectable(cell) else max(1, runs // OTHER_CELLS_DIVISOR)
            by_group.setdefault(AircraftGroup.of(cell), []).extend([index] * count)
    batches = list[tuple[AircraftGroup, tuple[int, ...]]]()
    for group, indices in by_group.items():
        shuffled = rng.permutation(indices).tolist()
        batches += [
            (group, tuple(shuffled[at : at + FAULTS_PER_FLIGHT])) for at in range(0, len(shuffled), FAULTS_PER_FLIGHT)
        ]
    order = rng.permutation(len(batches)).tolist()
    return [FlightTask(seed, number, batches[at][0], batches[at][1], duration_s) for number, at in enumerate(order)]
