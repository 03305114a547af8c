"""Panels to publish messages and to call services, with the log of what was sent."""
