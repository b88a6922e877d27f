"""Which elevation model agrees with the ranges of the altimeters of a recorded flight.

samples.py    measured ranges, and where the altimeter was and pointed, at any time
surfaces.py   an elevation model as a narrow or a wide beam measures it
fit.py        bias, shift and lag of the measured ground against one elevation model
judge.py      all elevation models: fits, refusals, comparison in pairs, classes of land cover
report.py     text and JSON
plot.py       residuals on the track, over each elevation model
"""
