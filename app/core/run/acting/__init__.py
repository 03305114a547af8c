"""Acting by hand: messages that a person keeps and sends, services that they call, the switch for both.

Nothing here knows the window.
"""
