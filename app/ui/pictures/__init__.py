"""Pictures of a stream: how they are shown, zoomed, and marked with what was recognised."""
