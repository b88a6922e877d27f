"""The clocks of devices: when a measurement was true."""
