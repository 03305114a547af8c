"""Worlds: sources of messages with everything known about them, such as the live network.

Panels show one world at a time. To add a kind of world, derive a class from `world.World`. The world of a
recording is in `app.core.recording.replay`.
"""
