"""BEMT against folders of measured propellers (`command` joins the rest)."""
