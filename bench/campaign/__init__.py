"""Campaigns: thousands of independent cases on every core or on a cluster, resumable, the same whoever computes."""
