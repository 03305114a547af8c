"""Behaviours as documents: tabs, files, journals, versions and problems.

`open_documents` has the tabs, `document` is one of them; `journal` is the backup against a crash.
"""
