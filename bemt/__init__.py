"""Propeller and ducted-fan aerodynamics: blade element momentum theory beside CFD, bench and empirical models."""

__version__ = "0.2.0"
