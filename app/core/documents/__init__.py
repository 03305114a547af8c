"""Behaviours as documents: open ones and their tabs, their files, journals, earlier versions and problems."""
