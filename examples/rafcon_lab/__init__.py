"""A state machine of RAFCON that tends the laboratory's PCR-cycler."""
