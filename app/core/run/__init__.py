"""Running a behaviour: the program's process, its control and its output.

`control` is Run, Pause, Step and Stop; `runner` communicates with the process, whose other end is
`app.blocks.runtime.child`. `acting` is manual publishing and calling, which Stop ends too.
"""
