"""What goes wrong on purpose, as a mission file asks: in the air, in the vehicle, in its estimate and on the wire."""
