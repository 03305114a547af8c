"""Values as people read them: numbers, dates, a robot's sensors.

Words in a language come from `nep.i18n`; no widget is made here.
"""
