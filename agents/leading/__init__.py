"""Leading a team: path following, timed routes, known obstacles, waiting for followers, and formation commands.

No election of the leader (`lfa.protocol.lease`), no mapping or planning (`exploration/`).
"""
