"""Navigation: validity, compensation, ground-clearance integrity, glide slope, pipeline.  Pure."""
