"""Device clocks and the times of validity of measurements."""
