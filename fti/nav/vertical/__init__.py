"""The vertical channel alone: inertial height, held by an altimeter where satellites are gone."""
