"""Reading: one file as it is found, whole or not, its records one by one, and a recorded session as a whole."""
