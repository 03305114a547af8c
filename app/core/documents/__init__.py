"""Behaviours as documents: open ones and their tabs, their files, journals, earlier versions and problems.

`open_documents` has the tabs, `document` is one of them; `journal` is what a crash leaves.
"""
