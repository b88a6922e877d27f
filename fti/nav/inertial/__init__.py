"""What inertial sensors say about attitude, velocity and position."""
