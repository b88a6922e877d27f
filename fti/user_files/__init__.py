"""Files that a user writes: their tables with every key, as pages of the documentation and as templates."""
