"""Node graph as a drawing: nodes in groups, and lines for topics and services.

`node_graph` creates the drawing from the master's graph, and `activity` detects quiet nodes and
measures call rates. `layout` computes positions; `layout_thread` runs it in a background thread, and
`layout_process` in a child process. `walk` implements navigation with arrow keys, `dot` the export.
"""
