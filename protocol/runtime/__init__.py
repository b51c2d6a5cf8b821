"""The real-time loop around a Node: node host, journal, log lines and systemd notification.

No decision of an agent, a voter or the world may live here: a Node decides, the runtime only calls it.
"""
