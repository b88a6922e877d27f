"""Readers of single files, finished or damaged, of their records, and of whole sessions."""
