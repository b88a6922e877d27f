"""Ports of the emulator: the far end of every link of the daemon's configuration."""
