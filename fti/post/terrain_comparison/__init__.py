"""Comparison of the methods of position from the ground on one recorded flight, during its reprocessing.

observer.py    matches each profile with every method, from the navigated states of the flight
reference.py   where the aircraft was: ground truth of the emulator, or a filter with satellites
filters.py     the filter of the flight without satellites, alone and with the fixes of each method
statistics.py  one row for each method
report.py      text and JSON
plot.py        map, errors over time
"""
