"""Interferometric radar altimeter: the measured point, and the position of the aircraft by comparison with the terrain.

    closest_point     position of the measured point relative to the aircraft, in three forms
    absolute_match    shift with the smallest mean absolute difference of the points to the terrain, in batches
    correction_filter thirteen errors of an inertial system, corrected by the shifts
    strip_range       slant range that the altimeter would measure at many positions: for a particle filter

Frame: east, north, up of the terrain's local frame [m].  A shift is true minus navigated position, as in
``fti.nav.terrain_matching``.

Source: Oh 2019, sections 2.2, 3 and 4.3; Park, section IV (predicted range).
"""
