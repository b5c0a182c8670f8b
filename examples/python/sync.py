#!/usr/bin/env python3
"""Syncs, waits at most 5 s, and prints what is missing. Usage: sync.py TEAM_FILE AGENT"""
import sys

from moondb import Client, endpoint_of, team_of

team_file, agent = sys.argv[1:]
client = Client(endpoint_of(team_file, agent), team_of(team_file)[1])
progress = client.sync(limit_s=5)
print("complete" if progress.is_complete else "not complete")
for pair in progress.pairs:
    if not pair.is_complete:
        print(f"{pair.sender} to {pair.destination}: {pair.why or 'goes on'}")
