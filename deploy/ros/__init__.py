"""ROS 2 without ROS: a fleet as ordinary ROS 2 topics, bags and Foxglove channels, and ROS robots as members.

Needs the extra `ros`. Control decisions may not live here: everything outward is a view, everything inward an order.
"""
