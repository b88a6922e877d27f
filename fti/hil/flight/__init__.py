"""What is flown: everything that sensors can measure of a flight, from a plan, a recording or a model of an aircraft.

trajectory    State, and ``SplineFlight.from_samples(Samples(t, lat, lon, alt, roll, pitch, heading, wind_n))``
approach      down the published approach
"""
