"""Reading of recordings in a separate process, and the frames exchanged with that process."""
