"""Reading recordings in a process of its own, and the frames exchanged with it."""
