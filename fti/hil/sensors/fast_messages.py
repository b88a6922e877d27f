"""Fast constructors for the measurements of simulated sensors: half the time of the classes of ``fti.types``."""

from __future__ import annotations

from fti import types
from fti.drivers._fast_messages import fast_class

new_airspeed = fast_class(types.Airspeed)
new_attitude = fast_class(types.Attitude)
new_deflection = fast_class(types.SurfaceDeflection)
new_deviation = fast_class(types.Deviation)
new_dme_range = fast_class(types.DmeRange)
new_field = fast_class(types.MagneticField)
new_flow_angles = fast_class(types.FlowAngles)
new_impact_pressure = fast_class(types.ImpactPressure)
new_position = fast_class(types.Position)
new_pressure_altitude = fast_class(types.PressureAltitude)
new_radio_height = fast_class(types.RadioHeight)
new_range = fast_class(types.Range)
new_reading = fast_class(types.Reading)
new_sample = fast_class(types.ImuSample)
new_satellites = fast_class(types.Satellites)
new_stamp = fast_class(types.Stamp)
new_static_pressure = fast_class(types.StaticPressure)
new_status = fast_class(types.DeviceStatus)
new_temperature = fast_class(types.Temperature)
new_velocity = fast_class(types.Velocity)
