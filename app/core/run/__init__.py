"""Run of a behaviour: the program's process, its control, and its output.

`control` implements Run, Pause, Step and Stop. `runner` communicates with the process, which runs
`app.blocks.runtime.child`. `acting` implements manual publishing and calling, which Stop ends as well.
"""
