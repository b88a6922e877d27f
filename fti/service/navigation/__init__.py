"""The navigation process: decodes the frames of the ring and navigates with them."""
