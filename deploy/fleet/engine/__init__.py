"""Engines that start, watch and restart the processes of one machine: our own, and systemd."""
