"""Tests of single sources: a device that contradicts itself is refused without any other source.

Specified in ``docs/fault-detection.md``, section "Tests of one source".
"""
