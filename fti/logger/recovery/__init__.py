"""Recovery: closing of unfinished files, and extraction of the content of damaged ones."""
