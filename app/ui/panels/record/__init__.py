"""Panels to record messages, and to replay recordings."""
