"""Commands that run or check a program of nep: master, bridge, alarms, web server, doctor, blackboard."""
