"""Measurements of simulated sensors, thousands a second: made as the classes of ``fti.types`` are, in half the time."""

from __future__ import annotations

from fti import types
from fti.drivers._quick import quick_class

new_airspeed = quick_class(types.Airspeed)
new_attitude = quick_class(types.Attitude)
new_deflection = quick_class(types.SurfaceDeflection)
new_deviation = quick_class(types.Deviation)
new_dme_range = quick_class(types.DmeRange)
new_field = quick_class(types.MagneticField)
new_flow_angles = quick_class(types.FlowAngles)
new_impact_pressure = quick_class(types.ImpactPressure)
new_position = quick_class(types.Position)
new_pressure_altitude = quick_class(types.PressureAltitude)
new_radio_height = quick_class(types.RadioHeight)
new_range = quick_class(types.Range)
new_reading = quick_class(types.Reading)
new_sample = quick_class(types.ImuSample)
new_satellites = quick_class(types.Satellites)
new_stamp = quick_class(types.Stamp)
new_static_pressure = quick_class(types.StaticPressure)
new_status = quick_class(types.DeviceStatus)
new_temperature = quick_class(types.Temperature)
new_velocity = quick_class(types.Velocity)
