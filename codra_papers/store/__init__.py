"""A shop in which a pallet truck moves roll containers for pickers, among people (P2, sections 5 and 6)."""
