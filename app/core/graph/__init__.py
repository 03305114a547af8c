"""Node graph as a drawing: nodes in groups, and lines for topics and services.

`node_graph` creates the drawing from the master's graph. `activity` finds quiet nodes and call rates.
`layout` computes positions; `layout_thread` runs it outside the window's thread, `layout_process` outside its
process. `walk` implements navigation with arrow keys, `dot` the export.
"""
