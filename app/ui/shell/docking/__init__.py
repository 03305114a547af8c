"""The docks of a layout: their frames, places and sizes, and how they come back."""
