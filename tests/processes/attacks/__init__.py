"""Attacks on a secured fleet, each refused while the fleet drives on: the attacker has all of robot 3's keys."""
