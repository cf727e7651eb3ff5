"""The drive behind the rotor: bench map, motor constant, battery-ESC-motor-rotor model, thrusters on a body."""

CASE_PARTS = {
    "drive": "bemt.tools.drive.drive_result:full_document",
    "circuit": "bemt.tools.drive.drive_result:circuit",
}
ACTIONS = {name: f"bemt.tools.drive.actions:{name}" for name in ("drive", "map", "motor", "thrusters")}
