"""Child processes on this machine: start, identify, signal, wait, terminate (Linux only). No fleet or ssh code here."""
