"""From a run folder or a live fleet to something that a person reads."""
