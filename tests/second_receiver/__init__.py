"""A second ground and second altimeters, against which the product's heights and alarms are accepted.

This package shares no formula with the product's sensor models (``fti.ranging``, ``fti.hil.sensors``) and none with its
synthetic terrain: it was written from the radar equation and from numpy alone, so that agreement is not agreement of a
model with itself.  No part of the product imports it.

    ground      surfaces on a periodic grid of 2.5 m: level, hills, woods; elevation models of them with an error
    geometry    WGS84 and rotations, written again
    radar       two-way Gaussian antenna pattern, radar equation over patches of ground, range resolution, leading edge
                10 dB below the peak, several sweeps, steps of the RA-4500, thermal noise
    laser       first return of a footprint of 2 mrad, crowns that are penetrated, an axis that is off a little
    flights     60 to 80 m/s, 40 to 400 m above ground, banked and pitched; navigation errors drawn from stated sigmas
    heights     flights through the product's altimeter channel; errors over sigmas by case
    approaches  approaches to a runway in hills through the product's clearance monitor, with and without a fault

Print the table of heights, or count alarms:

    python -m tests.second_receiver heights --sites 6
    python -m tests.second_receiver approaches --runs 20

Everything is drawn from printed seeds; equal seeds give equal figures.  The model leaves out shadows (slopes of 20
degrees hide nothing from a beam of 40), multiple reflections, weather, and the time a receiver needs to lock.
"""
