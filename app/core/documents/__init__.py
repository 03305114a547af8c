"""Behaviours as documents: tabs, files, journals, versions and problems.

`open_documents` manages the tabs and `document` implements one of them; `journal` saves unsaved work against
a crash.
"""
