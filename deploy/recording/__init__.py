"""Recordings of runs: the run folder, writers and readers of `recording.mcap` and `events.jsonl`.

No figures, verdicts or live views belong here, and nothing on the control path may wait for a recorder.
"""
