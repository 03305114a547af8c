"""Formatting of values for display: numbers, dates, sensors.

Independent of widgets; translations come from `nep.i18n`.
"""
