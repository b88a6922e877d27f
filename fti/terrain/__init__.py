"""Elevation, synthetic surfaces, ray casting."""
