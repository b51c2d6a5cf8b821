"""`lfa run --lockstep`: agents as processes in virtual time, whose run is that of `lfa sim`, call by call.

World, link model and recorder are in the launcher; each agent's process executes the calls that it is granted.
"""
