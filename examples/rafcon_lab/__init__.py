"""Tending the laboratory's PCR-cycler by a state machine of RAFCON."""
