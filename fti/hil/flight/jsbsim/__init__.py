"""Flights from the flight dynamics model JSBSim with an autopilot on four routes.

    airframe   data of an aircraft, gains of the autopilot    track      ground track
    routes     approach, pattern, go-around, low level        autopilot  from the route to the controls
    fdm        JSBSim in SI units                             flight     guidance, run of a flight, its samples

JSBSim uses the same ellipsoid, a rotating Earth, and the scenario's wind, pressure and temperature.  Position,
attitude, wind and control surfaces come from JSBSim; sensors measure the air of ``Environment.atmosphere``.  The
package ``jsbsim`` is imported when a flight begins.
"""
