"""Outputs and health to other programs."""
