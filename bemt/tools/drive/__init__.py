"""The drive behind the rotor: bench map, motor constant, model of battery, ESC, motor and rotor."""

CASE_PARTS = {
    "drive": "bemt.tools.drive.drive_result:full_document",
    "circuit": "bemt.tools.drive.drive_result:circuit",
}
ACTIONS = {name: f"bemt.tools.drive.actions:{name}" for name in ("drive", "map", "motor")}
