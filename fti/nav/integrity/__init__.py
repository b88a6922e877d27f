"""Ground-clearance integrity and glide slope on a published approach."""
