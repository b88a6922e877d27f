"""Surface-ranging sensors over a terrain."""
