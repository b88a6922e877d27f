"""Export: a recording as tables with units, in CSV or Parquet."""
