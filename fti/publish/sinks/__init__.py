"""The sinks, one module for each protocol."""
