"""Formatting of values for people: numbers, dates, sensors.

Translations come from `nep.i18n`; no widgets here.
"""
