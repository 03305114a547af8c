"""Running a behaviour: the program's own process, its pause and end, and what is said of it.

`control` is Run, Pause, Step and Stop; `runner` talks with the process, whose other end is
`app.blocks.runtime.child`. `acting` is what a person sends and calls by hand, which Stop ends, too.
"""
