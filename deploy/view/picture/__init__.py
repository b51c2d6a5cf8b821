"""Picture of a team as frames and news, from any source of messages, and files made of it: JSON, HTML, GIF.

Nothing here draws live or takes orders: that is `deploy/web`.
"""
