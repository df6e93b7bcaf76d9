"""The picker's page (P2's PickerWebInterface): browsers write orders into the graph, and show the graph.

The page is served on this computer only. It writes everything as the agent `picker_page`, in the thread of the
simulation. It shows only values of the knowledge graph, never the world's truth.
"""
