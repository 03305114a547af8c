"""Manual publishing and calling: stored messages, services to call, and the switch that arms both.

Independent of the window.
"""
