"""The motion after a hit, of which the vehicle's own estimate may lack a part."""
