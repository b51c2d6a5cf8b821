"""`lfa ros` and `lfa foxglove`: a running fleet as ROS 2 topics and as Foxglove channels, and orders back to the fleet.

What a ROS message looks like may not live here: that is `deploy/ros/mapping.py`.
"""
