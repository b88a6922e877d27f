"""The snapshot recorder: stores the latest frames in memory and writes them to a file on a trigger."""
