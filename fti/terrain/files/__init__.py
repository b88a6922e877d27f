"""Elevation files: what they say of themselves, and how they become the layers of a terrain."""
