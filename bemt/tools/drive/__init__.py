"""The drive behind the rotor: bench map, motor constant, battery-ESC-motor-rotor model, thrusters on a body.

``bemt.drive("10x5", kv=1000, cells=3)`` estimates one from a label: ``help(bemt.app.library.drive)``.
"""
