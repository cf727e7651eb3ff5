"""Blade element momentum: residual and kernel (compiled), packing, duct, and the one way to solve a rotor."""
