"""Connections of pages and programs with the rosbridge v2 protocol."""
