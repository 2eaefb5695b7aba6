"""What a vehicle is: a YAML file each, and what such a file says of its sensors."""
