"""Which propeller, which motor constant, and a better blade: labels and motors against a target, blades for a thrust.

``bemt.design(6.0, 10, airspeed_m_s=15.0, rpm=7000)`` designs one: ``help(bemt.app.library.design)``.
"""
