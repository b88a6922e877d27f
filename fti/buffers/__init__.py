"""Triple buffer per link, ring between processes."""
