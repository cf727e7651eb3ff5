"""Parametric shapes of propellers and ducted fans: pure geometry, no aerodynamics.

Lengths in metres, angles in radians; other units carry a suffix.
Submodules: ``airfoil``, ``blade``, ``laws`` and ``designation``, ``rotor``, ``duct``; ``common``
is what they share.
"""
