"""Patterns beyond topics: services, surveys and parameters."""
