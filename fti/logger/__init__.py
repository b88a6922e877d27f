"""Recording: MCAP records, session folders, split files, storage targets and schemas.

The subpackages ``reading``, ``statistics``, ``export``, ``verify``, ``recovery`` and ``packing`` process finished
files.  The modules of this level import none of them.
"""
