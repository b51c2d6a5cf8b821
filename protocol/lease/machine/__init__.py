"""The lease of one process as a state machine: its memory, its table of transitions, the actions and the deadlines."""
