"""Fast constructors for the measurements of simulated sensors: half the time of the classes of ``fti.messages``."""

from __future__ import annotations

from fti.formats.fast_messages import fast_class
from fti.messages import measurements

new_airspeed = fast_class(measurements.Airspeed)
new_attitude = fast_class(measurements.Attitude)
new_deflection = fast_class(measurements.SurfaceDeflection)
new_deviation = fast_class(measurements.Deviation)
new_dme_range = fast_class(measurements.DmeRange)
new_field = fast_class(measurements.MagneticField)
new_flow_angles = fast_class(measurements.FlowAngles)
new_impact_pressure = fast_class(measurements.ImpactPressure)
new_position = fast_class(measurements.Position)
new_pressure_altitude = fast_class(measurements.PressureAltitude)
new_radio_height = fast_class(measurements.RadioHeight)
new_range = fast_class(measurements.Range)
new_reading = fast_class(measurements.Reading)
new_sample = fast_class(measurements.ImuSample)
new_satellites = fast_class(measurements.Satellites)
new_stamp = fast_class(measurements.Stamp)
new_static_pressure = fast_class(measurements.StaticPressure)
new_status = fast_class(measurements.DeviceStatus)
new_temperature = fast_class(measurements.Temperature)
new_velocity = fast_class(measurements.Velocity)
