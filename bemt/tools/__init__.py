"""What is done with a rotor: drive, design, flight, exports, cfd. Nothing outside of this folder imports a tool."""
