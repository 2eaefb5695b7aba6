"""The harness that every case goes through. Nothing else here joins a companion and a vehicle."""
