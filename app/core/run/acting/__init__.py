"""Manual acting: saved messages, services to call, and the switch for both.

Independent of the window.
"""
