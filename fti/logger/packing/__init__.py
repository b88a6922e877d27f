"""Packing: finished files in compressed chunks, and back to the same bytes."""
