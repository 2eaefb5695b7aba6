"""The MAVLink edge: bytes to typed samples and typed commands to bytes. Only this package imports pymavlink."""
