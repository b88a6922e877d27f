"""Links: serial, UDP, CAN.  The only code that touches a port."""
