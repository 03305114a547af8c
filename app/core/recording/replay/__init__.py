"""Replay of a recording as a source of topics and messages, next to the live network.

A replay publishes nothing, unless the user arms `app.core.recording.replay.sending`.
"""
