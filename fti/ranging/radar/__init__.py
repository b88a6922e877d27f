"""FMCW radar altimeter: a bundle of rays, an antenna, the radar equation, receivers and a leading edge."""
