"""The drive behind the rotor: bench map, motor constant, battery-ESC-motor-rotor model, thrusters on a body."""
