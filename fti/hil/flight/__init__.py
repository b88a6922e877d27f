"""What is flown: everything that sensors can measure of a flight, from a plan, a recording or a model of an aircraft.

trajectory    State; ``SplineFlight.from_samples(Samples(t, lat, lon, alt, roll, pitch, heading, wind_n))``
making        from the table ``[flight]`` of a scenario to its flight: one maker for each kind
approach      down the published approach, with wander, gusts and side steps
waypoints     straight legs and turns of a bank limit
recorded      from a table (``table``) or a session (``session``), filtered (``smoothing``)
jsbsim        a flight-dynamic model with an autopilot
coordinated   the attitude of who flies a path without slipping
surroundings  is the terrain below known, and below
spline        quintic splines; banded: their systems of equations
"""
