"""Open projects with their files, journals, versions and problems.

`open_projects` manages the tabs, `open_project` implements one project, `project_files` opens, saves and
closes its file, and `journal` protects unsaved work against crashes.
"""
