"""Grammar and schedule of faults: parsing and timing only.

No signals, processes or bus connections may live here; the launcher, the simulator and `lfa fault` execute the faults.
"""
