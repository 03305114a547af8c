"""What the commands do with a window, and when they can't be done."""
