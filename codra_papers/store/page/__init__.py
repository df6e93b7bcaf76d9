"""The picker's page (P2's PickerWebInterface): orders go from browsers into the graph, and the graph is shown in them.

It is served on this machine only. All that it writes, it writes as the agent `picker_page`, in the thread of the
simulation; all that it shows is in the knowledge graph, never the world's truth.
"""
