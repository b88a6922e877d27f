"""Figures of the study ``ranging``."""
