"""Other controllers than the law, for comparison, found through the entry points `lfa.controllers`."""
