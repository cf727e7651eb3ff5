"""Ground floor: errors, units, tables, cache, checked TOML, data folders. Knows no rotor."""
