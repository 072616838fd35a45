"""What was given, looked at before anything is solved: each likely mistake by its name.

A check is a function of maps and rig that returns findings; a new one is one function and its place
in ``CHECKS`` in :mod:`.examine`. Plain NumPy. False alarms are worse than misses: what a sound rig
can look like is not reported.
"""
