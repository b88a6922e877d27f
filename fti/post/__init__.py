"""Work on a finished session."""
