"""Node graph as a drawing: nodes in groups, and lines for topics and services.

`node_graph` creates it from the master's graph, `activity` finds quiet nodes and call rates, `layout`
computes positions (`layout_thread` outside the window's thread, `layout_process` outside its process), `walk`
is navigation with arrow keys, `dot` exports it.
"""
