"""Names of the files in a fleet's folder on one machine. Light to import, for `lfa down`."""

from __future__ import annotations

PART = "part.json"
"""Plan of the machine."""
SOCKET = "router.sock"
SIGNS = "notify.sock"
"""Socket for the signs of life of the machine's processes."""
LEDGER = "processes.json"
"""Supervisor and processes of the machine, beside the plan."""
