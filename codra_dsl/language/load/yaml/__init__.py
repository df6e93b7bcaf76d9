"""Read YAML with positions: bytes -> nodes. Mistakes of punctuation are repaired, and fixes are offered for them."""
