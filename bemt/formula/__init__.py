"""K1/K2 and the compact formula on measured propellers (`command` joins them)."""
