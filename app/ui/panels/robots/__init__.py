"""Panels of one robot, and the panel with the controls of all robots."""
