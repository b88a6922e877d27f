"""The display process: serves the page, fed from the bus."""
