"""The supervisor: starts the other processes, watches them, serves operators and publishes events and health."""
