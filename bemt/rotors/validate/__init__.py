"""BEMT against folders of measured propellers."""
