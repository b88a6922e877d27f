"""Proof: is every number there, every byte accounted for, every checksum right, and what that amounts to."""
