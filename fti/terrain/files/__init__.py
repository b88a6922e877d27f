"""Elevation files: their metadata, and their conversion to layers of a terrain."""
