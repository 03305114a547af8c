"""Image display: fitting, zoomed, and annotated with detections.

Used by the panels Image and Camera; images are decoded by `app.core.messages`.
"""
