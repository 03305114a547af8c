"""Behaviours as documents: tabs, files, journals, versions and problems.

`open_documents` manages the tabs, `document` implements one behaviour, and `journal` protects unsaved
work against crashes.
"""
