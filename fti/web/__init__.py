"""The page of the flight-test engineer."""
