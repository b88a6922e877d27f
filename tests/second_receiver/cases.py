"""The cases in which heights are accepted."""

from tests.second_receiver.heights import Case

GROUNDS = ("level", "hills", "woods")
SENSORS = ("radar", "laser")
KNOWN = tuple(Case(ground, sensor) for ground in GROUNDS for sensor in SENSORS)
FINE = tuple(Case(ground, "radar", steps=False) for ground in GROUNDS)
WHOLE_BEAM = tuple(Case(ground, "radar", model="beam") for ground in GROUNDS)
UNKNOWN = tuple(Case("hills", sensor, known=False) for sensor in SENSORS)
#: Those of the same ground and flights follow each other.
HEIGHT_CASES = tuple(sorted(KNOWN + FINE + WHOLE_BEAM + UNKNOWN, key=lambda case: case.stream))
