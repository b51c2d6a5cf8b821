"""What an operator tells one robot at run time: the fleet stop, changes of the mission, and who is in the team.

How the robot drives, and who leads, may not live here.
"""
