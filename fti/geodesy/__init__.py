"""WGS84, rotations, local frames."""
