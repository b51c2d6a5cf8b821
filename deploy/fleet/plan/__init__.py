"""Fleet file and the plans derived from it, as data. No ssh, Zenoh session or process start belongs here."""
