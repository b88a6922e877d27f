"""The snapshot recorder: the latest frames in memory, written to a file on command."""
