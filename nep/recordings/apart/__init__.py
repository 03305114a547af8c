"""Recordings that are read in a process of their own, and the frames between the two processes."""
