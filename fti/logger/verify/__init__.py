"""Integrity verification of a session: sequence numbers, byte accounts, checksums, and a result."""
