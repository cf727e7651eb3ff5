"""What is done with a rotor: drive, design, flight, exports, cfd, stand. Nothing else imports a tool."""
