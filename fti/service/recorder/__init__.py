"""The recorder process: receives, numbers, accounts for and writes every byte.  It decodes nothing."""
