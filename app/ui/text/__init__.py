"""Formatting of numbers, dates, nodes and sensor values for display, and escaping of received names.

Independent of widgets; translations are those of `nep.i18n`.
"""
