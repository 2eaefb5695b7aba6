"""The command `rebound`: joins the companion and the simulated vehicle and does their files and output."""

__version__ = "0.1.0"
