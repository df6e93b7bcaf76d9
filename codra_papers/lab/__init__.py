"""A medical laboratory in which a mobile manipulator tends a centrifuge and a PCR-cycler (P1, section 4)."""
