"""YAML with positions: bytes to nodes, repair of punctuation mistakes, and the fixes for them."""
