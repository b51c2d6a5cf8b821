"""Shared rigs of the tests: simulated worlds and leases, live teams, hosts. No test or product code may live here."""
