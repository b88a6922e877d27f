"""The processes of the daemon, and the fault guard under which every unit runs."""
