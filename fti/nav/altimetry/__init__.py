"""From what an altimeter says to a height above ground that may be believed, or not."""
