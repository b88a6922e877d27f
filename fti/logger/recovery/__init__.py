"""Recovery: closing what a kill left open, and getting out of a damaged file what is there."""
