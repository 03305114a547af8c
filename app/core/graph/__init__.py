"""Who talks to whom, as a drawing: nodes in groups, and between them the lines of topics and services.

`node_graph` makes it from what the master told, `activity` knows who is quiet and how often services are
called, `layout` gives everything its place (`layout_thread` outside the window's thread, `layout_process`
outside its process), `walk` follows lines by arrow keys, `dot` writes it down for other programs.
"""
