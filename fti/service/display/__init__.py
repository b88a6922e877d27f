"""The display process: serves the page from the messages of the bus."""
