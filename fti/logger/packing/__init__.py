"""Packing: compression of finished files, and restoration of the same bytes."""
