"""Attitude, velocity and position from inertial sensors."""
