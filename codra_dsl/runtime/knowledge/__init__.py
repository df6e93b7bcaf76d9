"""Knowledge: P2's Deep State Representation, typed, owned and geometric (P2, sections 3.1 to 3.3)."""
