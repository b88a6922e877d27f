"""One main per process, and the guard under which every unit runs."""
