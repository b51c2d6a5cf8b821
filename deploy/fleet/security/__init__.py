"""Certificates, access rules and key files of a fleet. No ssh and no command line here."""
