"""Fault injection: values, clocks, bytes and buses of the emulated devices."""
