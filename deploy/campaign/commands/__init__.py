"""Commands `lfa campaign` and `lfa sim`."""
