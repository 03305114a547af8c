"""Opening, saving and closing behaviours in the window."""
