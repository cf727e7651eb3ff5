"""Published data: where they are found, and how they get there (`command` joins them).

`folders` is asked by rooms far below `command`, so nothing is imported here.
"""
