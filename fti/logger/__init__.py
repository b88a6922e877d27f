"""Recording.  Here stands what writes: records, session folders, files that split, places, schemas.

What is done with the files later has rooms of its own, which nothing here imports: ``reading``, ``survey``, ``export``,
``proof``, ``recovery`` and ``packing``.
"""
