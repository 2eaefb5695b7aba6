"""The examples that ship: `rebound init --example NAME` writes one."""
