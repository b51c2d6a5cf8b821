"""The shapes that the paper's figures must show (control.md 7.1), judged on recorded runs: `lfa verify`."""
