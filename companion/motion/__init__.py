"""How the vehicle moves by what is told and what its accelerometer adds up to, in the vehicle's boot clock."""
