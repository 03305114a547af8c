"""Formatting of numbers, dates and sensor values for display.

Independent of widgets; translations are those of `nep.i18n`.
"""
