"""Bars of the window, with the banner and toasts above them.

Bars only display state; their buttons trigger the actions of commands.
"""
