"""Several machines, and the one process that each of them needs: its router."""
