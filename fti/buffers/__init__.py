"""Triple buffer per link, ring between processes, latest value for the display."""
