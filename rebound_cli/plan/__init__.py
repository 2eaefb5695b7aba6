"""`rebound plan`: missions from and for QGroundControl's .plan files."""
