"""Flights from JSBSim: a flight dynamic model of other people, an autopilot of ours, four routes.

    settings   [flight] kind = "jsbsim"            airframe   what we know of an aircraft; the gains of its autopilot
    track      where it is flown over the ground    routes     approach, pattern, go-around, low level
    terrain_following   how high, over hills        autopilot  from the route to the controls
    fdm        JSBSim in SI units                   flight     flies, and gives what was flown

JSBSim flies on the same ellipsoid, over a rotating Earth, in the scenario's wind, pressure and temperature.  Only
position, attitude, the flow of the air and the control surfaces are taken from it: what sensors say of the air comes
from the world's own atmosphere.  The package ``jsbsim`` is loaded when a flight begins, not before.
"""
