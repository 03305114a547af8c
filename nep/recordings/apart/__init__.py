"""Reading recordings in a separate process, and the frames exchanged with this process."""
