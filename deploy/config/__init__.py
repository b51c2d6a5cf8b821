"""Commands on scenario and fleet files: list, validate, schema. No code that starts a run belongs here."""
