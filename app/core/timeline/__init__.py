"""Contents of a timeline as data: visible range, ruler, lanes and their marks, and formatting of times.

`app.ui.timeline` shows them. Panels make lanes from what they show, such as a recording or a trace.
"""
