"""A virtual robot in its room, painted from its state."""
