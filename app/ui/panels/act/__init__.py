"""Panels to publish messages and to call services, and the log of sent messages and calls."""
