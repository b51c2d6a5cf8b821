"""Transport of encoded messages: the bus interface with its inbox, the Zenoh session and router, and the link model.

No message content may be interpreted here, except that the inbox recognises HELLO and GRANT by their marks.
"""
