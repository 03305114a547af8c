"""Widgets that display images, fitted to the view or zoomed, with annotations and detections.

Used by the panels Image and Camera; `app.core.messages` decodes the images.
"""
