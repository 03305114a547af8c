"""A program while it runs, in a process of its own: scripts that take turns, robots, topics, values."""
