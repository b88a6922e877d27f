"""Trajectories of simulated flights, from a plan, a recording or a flight dynamics model.

trajectory          ``SplineFlight.from_samples(FlightSamples(t, lat, lon, alt, roll, pitch, heading, wind_n))``
factory             creates the flight from the table ``[flight]`` of a scenario: one function for each kind
approach            the published approach, with wander, gusts and side steps
waypoints           straight legs and turns of a bank limit
recorded_flight     from a table or a session (``session``), filtered (``smoothing``)
jsbsim              a flight dynamics model with an autopilot
coordinated_flight  attitude without sideslip for a given path
spline              quintic splines; banded_solver: their systems of equations
"""
