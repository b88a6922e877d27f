"""Outputs for other programs: a queue for each sink, and the sinks, each in the protocol of its peers.

A sink sends only.  What a peer sends is never a command.
"""
