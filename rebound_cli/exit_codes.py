"""The exit codes of every command but 0; docs/reference/commands.md has the table."""

ERROR = 1
# argparse's own, for a command line that cannot be read.
USAGE = 2
# EX_CONFIG of sysexits.h, which systemd knows as CONFIG.
CONFIGURATION = 78
# The shell's convention for a program ended by Ctrl-C: 128 + SIGINT.
INTERRUPTED = 130

# A restart with the same command line and files ends the same way.
PERMANENT = (USAGE, CONFIGURATION)
