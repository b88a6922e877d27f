"""Hardware in the loop: trajectory, sensor models, faults, emulator and replay."""
