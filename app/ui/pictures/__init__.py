"""Widgets that display images, fitted or zoomed, with annotations and detections.

Used by the panels Image and Camera; images are decoded by `app.core.messages`.
"""
